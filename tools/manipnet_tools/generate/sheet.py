"""A picture sheet of a generated set: do its grasps look like people's?"""

from collections import Counter
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array, Side, mirror_points, quat_rotate, transform
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.skin import skinned
from manipnet.synthesis.objects.mesh import load_mesh
from manipnet_tools.rendering import SKIN_LEFT, SKIN_RIGHT, Camera, Image, PaintedMesh, contact_sheet, render, save_png
from manipnet_tools.takes.dataset import mesh_file, take_folders
from manipnet_tools.takes.take_file import GeneratedTake, read_take_file

PICTURES: Final = 48
COLUMNS: Final = 8
SIZE: Final = (240, 210)
_SIDE_COLOURS: Final[dict[Side, tuple[float, float, float]]] = {"right": SKIN_RIGHT, "left": SKIN_LEFT}


def write_grasp_sheet(folder: Path, path: Path) -> None:
    """Draw grasps of as many kinds of shapes and grasps as there are; the names are in `path` with the suffix .txt."""
    seen: Counter[tuple[str, str]] = Counter()
    candidates = []
    for take_folder in take_folders(folder):
        take, hand = read_take_file(take_folder)
        for event in take.notes["events"]:
            if event["event"] != "near":
                kind = take.notes["shape"], event["grasp"]
                candidates.append((seen[kind], len(candidates), take_folder.name, take, hand, event))
                seen[kind] += 1
    candidates.sort(key=lambda candidate: candidate[:2])
    pictures, lines = [], []
    for _, _, name, take, hand, event in candidates[:PICTURES]:
        at_s = 0.5 * (event["start_s"] + event["end_s"])
        pictures.append(_picture(folder, take, hand, event["side"], int(at_s * take.rate_hz)))
        lines.append(f"{len(lines)}: {name} at {at_s:.2f} s, {event['side']}, {take.notes['shape']}, {event['grasp']}")
    if pictures:
        save_png(contact_sheet(pictures, COLUMNS), path)
        path.with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _picture(folder: Path, take: GeneratedTake, hand: Hand, side: Side, frame: int) -> Image:
    """The object and both hands at a frame, seen from the thumb's and palm's side of one hand."""
    mesh = load_mesh(mesh_file(folder, take.object_name))
    meshes = [PaintedMesh(transform(take.object[frame], mesh.vertices), mesh.faces.astype(np.int64))]
    for other, colour in _SIDE_COLOURS.items():
        vertices, faces = _skin(hand, take, other, frame)
        meshes.append(PaintedMesh(vertices, faces, colour))
    wrist = take.wrists[side][frame]
    toward = mirror_points(np.array([0.25, 0.6, -0.45])) if side == "left" else np.array([0.25, 0.6, -0.45])
    middle = mirror_points(np.array([0.1, 0.0, -0.03])) if side == "left" else np.array([0.1, 0.0, -0.03])
    target = transform(wrist, middle)
    toward = quat_rotate(wrist[3:], toward)
    return render(meshes, Camera(target + 0.55 * toward / np.linalg.norm(toward), target), SIZE)


def _skin(hand: Hand, take: GeneratedTake, side: Side, frame: int) -> tuple[Array, NDArray[np.int64]]:
    vertices = skinned(hand, *forward_kinematics(hand, take.angles[side][frame]))
    faces = hand.skin.faces.astype(np.int64)
    if side == "left":
        vertices, faces = mirror_points(vertices), faces[:, ::-1]
    return transform(take.wrists[side][frame], vertices), faces
