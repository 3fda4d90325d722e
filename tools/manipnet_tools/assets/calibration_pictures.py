"""Draw the pictures of docs/calibration.md and of the page, and the printable sheet.

Run `python -m manipnet_tools.assets.calibration_pictures`.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np

from manipnet.actors.calibration import HAND_LENGTH_M, MARK_M, wrist_on_sheet
from manipnet.geometry import Array, Side, mirror_points, transform
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.skin import skinned
from manipnet.synthesis.model.shipped import shipped_hand

HOUSE: Final = Path(__file__).parents[3]
IMAGES, PAGE = HOUSE / "docs" / "images", HOUSE / "server" / "manipnet" / "page"
PAPER: Final = (0.42, 0.297)
"""A3, landscape, metres."""
TABLE_M: Final = 0.56
"""Edge of the square that the picture shows."""
PIXELS: Final = 520
FINE: Final = 3
INK, GREY, RED, GREEN, BLUE = (25, 25, 30), (140, 140, 145), (190, 40, 30), (30, 130, 50), (30, 70, 190)
LIGHT: Final = np.array([-0.35, 0.86, -0.37])
SKINS: Final[dict[Side, tuple[int, int, int]]] = {"left": (214, 170, 150), "right": (228, 184, 158)}


def main() -> None:
    """Write all pictures and the sheet."""
    from PIL import Image

    near = [round(edge / FINE) for edge in (*_pixel(-0.235, -0.165), *_pixel(0.235, 0.275))]
    panel(np.zeros(7)).crop(near).save(PAGE / "wrists.png")
    panel(_drawn_back()).crop(near).save(PAGE / "fingertips.png")
    panels = [panel(np.zeros(7), "1  wrists on the marks"), panel(_drawn_back(), "2  fingertips on the centre line")]
    both = Image.new("RGB", (2 * PIXELS + 20, PIXELS), "white")
    for i, image in enumerate(panels):
        both.paste(image, (i * (PIXELS + 20), 0))
    both.save(IMAGES / "calibration.png")
    (IMAGES / "calibration-sheet.svg").write_text(sheet_svg(), encoding="utf-8")


def panel(moved: Array, title: str = "") -> Any:
    """Draw the sheet from above, with the operator at the bottom edge and both hands `moved` from their marks."""
    from PIL import Image, ImageDraw, ImageFont

    image = Image.new("RGB", (FINE * PIXELS, FINE * PIXELS), (176, 150, 122))
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(FINE * 15)
    half_x, half_z = PAPER[0] / 2, PAPER[1] / 2
    draw.rectangle([*_pixel(-half_x, -half_z), *_pixel(half_x, half_z)], fill=(248, 248, 244))
    mark_x, mark_z = MARK_M
    for a, b in [((-half_x, 0), (half_x, 0)), *(((s * mark_x, -half_z), (s * mark_x, half_z)) for s in (-1, 1))]:
        draw.line([*_pixel(*a), *_pixel(*b)], fill=GREY, width=FINE)
    for side in SKINS:
        _draw_hand(draw, side, moved)
    for s in (-1, 1):
        draw.line([*_pixel(s * mark_x - 0.03, mark_z), *_pixel(s * mark_x + 0.03, mark_z)], fill=INK, width=2 * FINE)
        x, y = _pixel(s * mark_x, mark_z)
        draw.ellipse([x - 5 * FINE, y - 5 * FINE, x + 5 * FINE, y + 5 * FINE], outline=INK, width=2 * FINE)
    for end, color, name in (((0.03, 0.0), RED, "x"), ((0.0, 0.05), BLUE, "z")):
        draw.line([*_pixel(0.0, 0.0), *_pixel(*end)], fill=color, width=3 * FINE)
        draw.text(_pixel(end[0] + 0.006, end[1] - 0.006), name, fill=color, font=font)
    x, y = _pixel(0.0, 0.0)
    draw.ellipse([x - 4 * FINE, y - 4 * FINE, x + 4 * FINE, y + 4 * FINE], fill=GREEN)
    draw.text(_pixel(-0.026, -0.022), "y up", fill=GREEN, font=font)
    draw.text(_pixel(-0.268, -0.272), title, fill=(255, 255, 255), font=font)
    return image.resize((PIXELS, PIXELS), Image.Resampling.LANCZOS)


def _drawn_back() -> Array:
    return np.array([0.0, 0.0, HAND_LENGTH_M - MARK_M[1], 0.0, 0.0, 0.0, 0.0])


def _draw_hand(draw: Any, side: Side, moved: Array) -> None:
    """Draw a flat hand, lit from above, and the marker cluster on its back."""
    hand = shipped_hand()
    vertices = skinned(hand, *forward_kinematics(hand, np.zeros(hand.angle_count)))
    faces = hand.skin.faces
    cluster = np.array([[-0.035, 0.02, 0.03], [-0.035, -0.02, 0.03], [0.0, 0.0, 0.03]])
    if side == "left":
        vertices, cluster, faces = mirror_points(vertices), mirror_points(cluster), faces[:, ::-1]
    wrist = wrist_on_sheet(side) + moved
    corners, markers = transform(wrist, vertices)[faces], transform(wrist, cluster)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    shades = 0.55 + 0.45 * normals @ LIGHT / np.linalg.norm(normals, axis=1)
    for k in np.argsort(corners[:, :, 1].mean(axis=1)):  # the highest is drawn last
        if normals[k, 1] > 0.0:
            color = tuple(round(channel * shades[k]) for channel in SKINS[side])
            draw.polygon([_pixel(x, z) for x, _, z in corners[k]], fill=color)
    for a, b in zip(markers, np.roll(markers, 1, axis=0), strict=True):
        _capsule(draw, a, b, 0.0015, INK)
    for marker in markers:
        _capsule(draw, marker, marker, 0.006, (205, 205, 212))


def _capsule(draw: Any, start: Array, end: Array, radius: float, color: tuple[int, int, int]) -> None:
    size = radius / TABLE_M * FINE * PIXELS
    ends = [_pixel(start[0], start[2]), _pixel(end[0], end[2])]
    draw.line([*ends[0], *ends[1]], fill=color, width=max(round(2 * size), 1))
    for x, y in ends:
        draw.ellipse([x - size, y - size, x + size, y + size], fill=color)


def _pixel(x: float, z: float) -> tuple[float, float]:
    scale = FINE * PIXELS / TABLE_M
    return (x + TABLE_M / 2) * scale, (z + TABLE_M / 2) * scale


def sheet_svg() -> str:
    """The sheet at its real size, in millimetres, for A3 landscape with the operator at the bottom edge."""
    width, height = (1e3 * size for size in PAPER)
    cx, cy, x, z = width / 2, height / 2, 1e3 * MARK_M[0], 1e3 * MARK_M[1]
    parts = [_line(0, cy, width, cy), _text(cx - 60, cy - 3, "centre line"), _line(cx - 8, cy, cx + 8, cy, 1.2)]
    parts += [_line(cx, cy - 8, cx, cy + 8, 1.2), _line(cx, cy, cx + 40, cy, 1.0), _text(cx + 40, cy + 6, "+x")]
    parts += [_line(cx, cy, cx, cy + 40, 1.0), _text(cx + 6, cy + 46, "+z, to the operator")]
    for name, here in (("left", cx - x), ("right", cx + x)):
        parts += [_line(here, 0, here, height), _line(here - 40, cy + z, here + 40, cy + z, 1.0)]
        parts += [f'<circle cx="{here:g}" cy="{cy + z:g}" r="4" fill="none" stroke="black"/>']
        parts += [_text(here + 22, cy + z + 8, f"{name} wrist")]
        for centimetre in range(12, 24):
            at = cy + z - 10 * centimetre
            parts += [_line(here - 6, at, here + 6, at), _text(here + 10, at + 1.5, str(centimetre))]
        parts += [_text(here + 26, cy + z - 10 * 12 + 1.5, "cm to the wrist")]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" '
        f'viewBox="0 0 {width:g} {height:g}" font-family="sans-serif" font-size="4.5" text-anchor="middle">\n'
        + "\n".join(parts)
        + "\n</svg>\n"
    )


def _line(x1: float, y1: float, x2: float, y2: float, width: float = 0.4) -> str:
    return f'<line x1="{x1:g}" y1="{y1:g}" x2="{x2:g}" y2="{y2:g}" stroke="black" stroke-width="{width:g}"/>'


def _text(x: float, y: float, text: str) -> str:
    return f'<text x="{x:g}" y="{y:g}">{text}</text>'


if __name__ == "__main__":
    main()
