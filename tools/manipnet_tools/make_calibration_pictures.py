"""Pictures of docs/calibration.md, and the printable sheet: `python -m manipnet_tools.make_calibration_pictures`."""

import math
from pathlib import Path
from typing import Final

import numpy as np

from manipnet.calibration import HAND_LENGTH_M, MARK_M, wrist_on_sheet
from manipnet.geometry import Array, mirror_points, transform
from manipnet.hand.kinematics import forward_kinematics
from manipnet.hand.skeleton import DOF_LIMITS_RAD, DOF_NAMES
from manipnet.hand.surface import FACES, skin
from manipnet.synthesis import Side
from manipnet_tools.render import SKIN_LEFT, SKIN_RIGHT, Camera, Solid, beads, contact_sheet, render, rods, save_png

IMAGES: Final = Path(__file__).parents[2] / "docs" / "images"
INK, RED, BLUE = (0.10, 0.10, 0.12), (0.75, 0.12, 0.10), (0.10, 0.25, 0.70)
PAPER: Final = (0.42, 0.297)
"""A3, metres."""
SIZE: Final = (760, 560)


def main() -> None:
    """Write all of them."""
    flat, back = np.zeros(7), np.array([0.0, 0.0, HAND_LENGTH_M - MARK_M[1], 0.0, 0.0, 0.0, 0.0])
    above = Camera.orbit(np.array([0.0, 0.02, 0.03]), 1.15, 0.0, math.radians(62))
    views = [render([*_sheet(), *_hands(flat)], above, SIZE, floor_y=-0.004)]
    views.append(render([*_sheet(), *_hands(back)], above, SIZE, floor_y=-0.004))
    save_png(contact_sheet(views, 2), IMAGES / "calibration.png")
    (IMAGES / "calibration-sheet.svg").write_text(sheet_svg(), encoding="utf-8")


def _hands(moved: Array) -> list[Solid]:
    """Both hands flat, thumbs beside the palm, with a cluster of three markers each."""
    angles = np.zeros(20)
    angles[DOF_NAMES.index("THUMB_CMC_FE")] = DOF_LIMITS_RAD[0, 0]
    positions, rotations = forward_kinematics(angles)
    vertices = skin(positions, rotations)
    cluster = np.array([[-0.02, 0.025, 0.045], [-0.02, -0.025, 0.045], [0.03, 0.0, 0.055]])
    solids: list[Solid] = []
    sides: tuple[Side, Side] = ("left", "right")
    for side in sides:
        wrist = wrist_on_sheet(side) + moved
        here, faces, balls = vertices, FACES, cluster
        if side == "left":
            here, faces, balls = mirror_points(vertices), FACES[:, ::-1], mirror_points(cluster)
        color = SKIN_LEFT if side == "left" else SKIN_RIGHT
        solids.append(Solid(transform(wrist, here), faces, color))
        markers = transform(wrist, balls)
        solids.append(beads(markers, 0.007, (0.85, 0.85, 0.88)))
        solids.append(rods(markers, np.roll(markers, 1, axis=0), 0.002, INK))
    return solids


def _sheet() -> list[Solid]:
    """The paper, its lines and marks, and the world's axes at its centre."""
    half_x, half_z = PAPER[0] / 2, PAPER[1] / 2
    corners = np.array([(-half_x, 0, -half_z), (half_x, 0, -half_z), (half_x, 0, half_z), (-half_x, 0, half_z)])
    x, z = MARK_M
    ends = [((-half_x, 0), (half_x, 0))]
    ends += [((side * x, -half_z), (side * x, half_z)) for side in (-1, 1)]
    ends += [((side * x - 0.04, z), (side * x + 0.04, z)) for side in (-1, 1)]
    lines = np.array([[(a[0], 0.0, a[1]), (b[0], 0.0, b[1])] for a, b in ends])
    axes = np.array([[0.06, 0, 0], [0, 0.06, 0], [0, 0, 0.06]])
    origin = np.zeros((1, 3))
    return [
        Solid(corners, np.array([(0, 2, 1), (0, 3, 2)]), (0.93, 0.93, 0.90)),
        rods(lines[:, 0], lines[:, 1], 0.0012, INK),
        *(rods(origin, axes[i : i + 1], 0.003, color) for i, color in enumerate((RED, (0.1, 0.5, 0.15), BLUE))),
    ]


def sheet_svg() -> str:
    """The sheet at its own size on A3, landscape: millimetres, the operator at the bottom edge."""
    width, height = (1e3 * size for size in PAPER)
    cx, cy, x, z = width / 2, height / 2, 1e3 * MARK_M[0], 1e3 * MARK_M[1]
    parts = [_line(0, cy, width, cy), _text(cx, cy - 3, "centre line (z = 0)"), _line(cx - 8, cy, cx + 8, cy, 1.2)]
    parts += [_line(cx, cy - 8, cx, cy + 8, 1.2), _line(cx, cy, cx + 40, cy, 1.0), _text(cx + 40, cy + 6, "+x")]
    parts += [_line(cx, cy, cx, cy + 40, 1.0), _text(cx + 6, cy + 42, "+z, to the operator")]
    for name, here in (("left", cx - x), ("right", cx + x)):
        parts += [_line(here, 0, here, height), _line(here - 40, cy + z, here + 40, cy + z, 1.0)]
        parts += [f'<circle cx="{here}" cy="{cy + z}" r="4" fill="none" stroke="black"/>']
        parts += [_text(here + 22, cy + z + 8, f"{name} wrist")]
        for centimetre in range(12, 24):
            at = cy + z - 10 * centimetre
            parts += [_line(here - 6, at, here + 6, at), _text(here + 10, at + 1.5, str(centimetre))]
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
