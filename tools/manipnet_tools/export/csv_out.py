"""Writes hands and objects as one table with a row for each frame; `docs/export.md` lists the columns."""

import csv
from pathlib import Path

import numpy as np

from manipnet.geometry import Array, Side, mirror_quats, quat_conjugate, quat_multiply, quat_to_matrix
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import angles_from_rotations
from manipnet_tools.export.animation import Animation, HandTrack

_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")


def write_csv(animation: Animation, path: Path) -> None:
    """Write the table in right-handed, Y-up coordinates, metres, radians and seconds. Raises `OSError`."""
    columns: dict[str, Array] = {"time_s": animation.time_s}
    for side, hand in animation.hands.items():
        columns |= _hand_columns(side, hand)
    for name, body in animation.objects.items():
        columns |= {f"{name}_{part}": body.poses[:, k] for k, part in enumerate(_POSE)}
        columns[f"{name}_tracked"] = body.tracked.astype(np.float64)
    timecode = animation.timecode
    rate = "" if timecode is None or timecode.rate is None else f"{timecode.rate:.8g}"
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["frame", *columns, *(("timecode", "timecode_rate") if timecode is not None else ())])
        for k, row in enumerate(np.column_stack(list(columns.values())).tolist()):
            cells = [k, *(f"{value:.8g}" for value in row)]
            writer.writerow(cells if timecode is None else [*cells, timecode.texts[k], rate])


def _hand_columns(side: Side, hand: HandTrack) -> dict[str, Array]:
    positions, rotations = hand.world()
    columns = {f"{side}_live": hand.live.astype(np.float64)}
    columns |= {f"{side}_wrist_{part}": hand.wrist[:, 3 + k] for k, part in enumerate(_POSE[3:])}
    angles = hand_angles(hand.model, side, rotations)
    columns |= {f"{side}_{name.lower()}_rad": angles[:, k] for k, name in enumerate(hand.model.angle_names)}
    for joint, name in enumerate(hand.model.joint_names):
        columns |= {f"{side}_{name.lower()}_{axis}": positions[:, joint, k] for k, axis in enumerate("xyz")}
    return columns


def hand_angles(model: Hand, side: Side, rotations: Array) -> Array:
    """The joint angles `(T, A)` that fit bone rotations `(T, B, 4)` in the world best."""
    quats = quat_multiply(quat_conjugate(rotations[:, :1]), rotations)
    return angles_from_rotations(model, quat_to_matrix(mirror_quats(quats) if side == "left" else quats))
