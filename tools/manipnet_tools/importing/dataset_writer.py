"""Writes imported takes in the layout of the dataset, which `manipnet train` and `manipnet evaluate` read.

DATA/BVH/<take>/leftHand.bvh, rightHand.bvh, <object>.bvh      at 120 Hz
DATA/meshes/<object>.obj                                       metres
DATA/sources.json                                              where each take comes from, and on what terms
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation, Slerp

from manipnet.geometry import SIDES, Array, Side
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.objects.mesh import ClosedMesh
from manipnet.synthesis.synthesizer import hand_to_world
from manipnet_tools.export.animation import Animation, hand_track
from manipnet_tools.export.bvh_out import write_bvh
from manipnet_tools.importing.retarget import START_RAD, Fit
from manipnet_tools.importing.source import ImportingError, SourceTake
from manipnet_tools.takes.take import BodyTrack

RATE_HZ: Final = 120.0
"""The rate of the dataset, which training needs."""
SHORTEST_S: Final = 1.2
"""A shorter piece leaves no tick between the half seconds before and after it."""
LONGEST_GAP_S: Final = 0.15
"""Frames are interpolated over shorter gaps; at longer ones a take is divided."""
ASIDE_M: Final = 0.6
"""How far from the other one a hand lies that the take does not have; training leaves it out."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a take without gaps: at times `(T,)`, of hands their fits, of objects their poses `(T, 7)`."""

    name: str
    time_s: Array
    fits: dict[Side, Fit]
    objects: dict[str, Array]


def pieces(take: SourceTake, fits: dict[Side, Fit], name: str) -> Iterator[Piece]:
    """The parts of a take in which all its hands and objects are there, except for short gaps."""
    seen = np.all(
        [np.isfinite(fit.angles).all(axis=1) for fit in fits.values()]
        + [np.isfinite(poses).all(axis=1) for poses in take.objects.values()],
        axis=0,
    )
    frames = np.flatnonzero(seen)
    breaks = np.flatnonzero(np.diff(frames) > max(LONGEST_GAP_S * take.rate_hz, 1.0))
    runs = [run for run in np.split(frames, breaks + 1) if len(run) and np.ptp(run) >= SHORTEST_S * take.rate_hz]
    for number, run in enumerate(runs, start=1):
        yield Piece(
            name if len(runs) == 1 else f"{name}-{number}",
            (run - run[0]) / take.rate_hz,
            {side: Fit(fit.wrist[run], fit.angles[run], fit.error_m[run]) for side, fit in fits.items()},
            {stem: poses[run] for stem, poses in take.objects.items()},
        )


def write_piece(piece: Piece, hand: Hand, data: Path) -> None:
    """Write the BVH files of a piece. Raises `ExportError` if there is a take of its name."""
    time_s = np.arange(int(piece.time_s[-1] * RATE_HZ + 1e-6) + 1) / RATE_HZ
    hands = {}
    for side in SIDES:
        if (fit := piece.fits.get(side)) is None:
            (other,) = piece.fits.values()
            wrist = np.tile(other.wrist[:1] + np.array([ASIDE_M, 0, 0, 0, 0, 0, 0]), (len(time_s), 1))
            angles = np.tile(np.clip(np.full(hand.angle_count, START_RAD), *hand.limits.T), (len(time_s), 1))
        else:
            wrist = _poses_at(piece.time_s, fit.wrist, time_s)
            angles = PchipInterpolator(piece.time_s, fit.angles)(time_s)
        positions, rotations = hand_to_world(side, wrist, *forward_kinematics(hand, angles))
        hands[side] = hand_track(hand, positions, rotations)
    seen = np.ones(len(time_s), dtype=np.bool_)
    objects = {name: BodyTrack(_poses_at(piece.time_s, poses, time_s), seen) for name, poses in piece.objects.items()}
    write_bvh(Animation(piece.name, RATE_HZ, time_s, hands, objects), data / "BVH" / piece.name)


def write_mesh(mesh: ClosedMesh, data: Path, name: str) -> None:
    """Write the mesh of an object. Raises `ImportingError` if the folder has another one of its name."""
    path = data / "meshes" / f"{name}.obj"
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
    text = "\n".join(lines) + "\n"
    if path.is_file() and path.read_text(encoding="utf-8") != text:
        raise ImportingError(f"{path} is another mesh; rename the object {name}, or write to another folder")
    path.write_text(text, encoding="utf-8")


def _poses_at(times_s: Array, poses: Array, wanted_s: Array) -> Array:
    """Poses `(T, 7)` at other times between the first and the last."""
    places = PchipInterpolator(times_s, poses[:, :3])(wanted_s)
    turns = Slerp(times_s, Rotation.from_quat(poses[:, 3:]))(wanted_s).as_quat()
    return np.concatenate([places, turns], axis=1)
