"""Takes: recorded bodies, with captured fingers where there are any, read from every supported file.

All are in the project frame: right-handed, Y up, metres, seconds, quaternions xyzw. Bodies `left_wrist` and
`right_wrist` are the wrist frames of `manipnet.synthesis.hand.hand`, the left one its mirror image.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import SIDES, Array, mirror_points, mirror_poses, mirror_quats, quat_multiply, quat_rotate
from manipnet.recording.mcap_file import RecordingError, read_bodies
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.wire.bodies import BodyFrame
from manipnet_tools.takes.bvh_motion import BvhError, BvhMotion, read_bvh
from manipnet_tools.takes.motive_csv import MotiveCsvError, read_motive_csv
from manipnet_tools.takes.trajectory import DECIMETRE_M, TrajectoryError, read_trajectory

RESTART_S = 0.5
"""A time this far back is a sender that started again."""


class TakeError(ValueError):
    """A take that cannot be read; the text names the file, the place and what was expected."""


@dataclass(frozen=True)
class BodyTrack:
    """One tracked body: world poses `(T, 7)` (position, quaternion) and whether it was seen, `(T,)`."""

    poses: Array
    tracked: NDArray[np.bool_]


@dataclass(frozen=True)
class Fingers:
    """Captured fingers of one hand, in the world: joints `(T, 22, 3)` and bone rotations `(T, 17, 4)`."""

    positions: Array
    rotations: Array


@dataclass(frozen=True)
class Take:
    """A recorded performance: `time_s` `(T,)` from zero, bodies by name, captured fingers by side."""

    name: str
    rate_hz: float
    time_s: Array
    bodies: dict[str, BodyTrack]
    fingers: dict[str, Fingers] = field(default_factory=dict)
    box_centred: bool = False
    """Objects are where the centres of their bounding boxes are, not where their meshes' origins are."""

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the bodies that are not wrists."""
        return tuple(name for name in self.bodies if name not in ("left_wrist", "right_wrist"))


def read_take(path: Path | str) -> Take:
    """Read a take: a folder of BVH files, a trajectory text, a Motive CSV or a recording. Raises `TakeError`."""
    path = Path(path)
    if path.is_dir():
        return read_bvh_folder(path)
    if not path.exists():
        raise TakeError(f"{path}: no such take")
    readers = {".txt": _read_trajectory, ".csv": _read_motive_csv, ".mcap": _read_recording}
    if path.suffix.lower() not in readers:
        raise TakeError(f"{path}: unknown kind of take; allowed are a folder of BVH files, {', '.join(readers)}")
    try:
        return readers[path.suffix.lower()](path)
    except (TrajectoryError, MotiveCsvError, RecordingError) as error:
        raise TakeError(str(error)) from None


def _read_trajectory(path: Path) -> Take:
    rate_hz, poses = read_trajectory(path)
    time_s = np.arange(len(poses["object"])) / rate_hz
    seen = np.ones(len(time_s), dtype=np.bool_)
    bodies = {name: BodyTrack(track, seen) for name, track in poses.items()}
    return Take(path.stem, rate_hz, time_s, bodies, box_centred=True)


def _read_motive_csv(path: Path) -> Take:
    """Names such as LeftWrist or "left hand" become the conventional ones; the others stay."""
    motive = read_motive_csv(path)
    bodies = {conventional(name): BodyTrack(*track) for name, track in motive.bodies.items()}
    return Take(path.stem, motive.rate_hz, motive.time_s, bodies)


def conventional(name: str) -> str:
    letters = "".join(filter(str.isalpha, name.lower()))
    sides = [side for side in SIDES if letters in (f"{side}wrist", f"{side}hand")]
    return f"{sides[0]}_wrist" if sides else name


def _read_recording(path: Path) -> Take:
    """The longest run of a recording's body frames, which ends where its sender restarted."""
    runs: list[dict[float, BodyFrame]] = []
    newest_s = np.inf
    for frame in read_bodies(path):
        if frame.t_s < newest_s - RESTART_S:
            runs.append({})
            newest_s = frame.t_s
        newest_s = max(newest_s, frame.t_s)
        runs[-1].setdefault(frame.t_s, frame)
    if not runs or len(longest := max(runs, key=len)) < 2:
        raise TakeError(f"{path}: holds no run of body frames")
    frames = [longest[t_s] for t_s in sorted(longest)]
    time_s = np.array([frame.t_s for frame in frames])
    return Take(path.stem, round(1.0 / float(np.median(np.diff(time_s))), 3), time_s - time_s[0], _tracks(frames))


def _tracks(frames: Sequence[BodyFrame]) -> dict[str, BodyTrack]:
    """Tracks by name, or by id for a body without; a lost body stays where it was last, or will be first."""
    tracks: dict[str, BodyTrack] = {}
    for k, frame in enumerate(frames):
        for body in frame.bodies:
            name = body.name or str(body.id)
            if name not in tracks:
                tracks[name] = BodyTrack(np.zeros((len(frames), 7)), np.zeros(len(frames), dtype=np.bool_))
            if body.tracked:
                tracks[name].poses[k], tracks[name].tracked[k] = (*body.p, *body.q), True
    tracks = {name: track for name, track in tracks.items() if track.tracked.any()}
    for track in tracks.values():
        track.poses[:] = track.poses[last_tracked(track.tracked)]
    return tracks


def last_tracked(tracked: NDArray[np.bool_]) -> NDArray[np.intp]:
    """For each frame the last one at which a body was tracked, or else its first such frame."""
    return np.maximum.accumulate(np.where(tracked, np.arange(len(tracked)), np.argmax(tracked)))


def read_bvh_folder(folder: Path) -> Take:
    """Read the ManipNet dataset's layout: `leftHand.bvh`, `rightHand.bvh`, one `<object>.bvh` per object."""
    try:
        files = {path.stem: read_bvh(path) for path in sorted(folder.glob("*.bvh"))}
    except BvhError as error:
        raise TakeError(str(error)) from None
    missing = {"leftHand", "rightHand"} - files.keys()
    if missing:
        raise TakeError(f"{folder}: no {' and no '.join(sorted(missing))}.bvh; a take needs both hands' files")
    lengths = {stem: len(bvh.motion) for stem, bvh in files.items()}
    rates = {round(1.0 / bvh.frame_time_s, 3) for bvh in files.values()}
    if len(set(lengths.values())) > 1 or len(rates) > 1:
        raise TakeError(f"{folder}: files must share length and rate, found {lengths} frames at {sorted(rates)} Hz")
    rate_hz = rates.pop()
    subject = shipped_hand()  # the dataset's subject, whose fingertips its files lack
    fingers = {side: _hand(folder / f"{side}Hand.bvh", files.pop(f"{side}Hand"), side, subject) for side in SIDES}
    tracks = {
        f"{side}_wrist": np.concatenate([hand.positions[:, 0], hand.rotations[:, 0]], axis=-1)
        for side, hand in fingers.items()
    }
    tracks |= {stem: _root_poses(bvh) for stem, bvh in files.items()}
    frames = len(tracks["left_wrist"])
    seen = np.ones(frames, dtype=np.bool_)
    bodies = {name: BodyTrack(poses, seen) for name, poses in tracks.items()}
    return Take(folder.name, rate_hz, np.arange(frames) / rate_hz, bodies, fingers)


def _root_poses(bvh: BvhMotion) -> Array:
    """Poses `(T, 7)` of the root, from left-handed decimetres to the project frame."""
    root = BvhMotion(bvh.joints[:1], bvh.frame_time_s, bvh.motion[:, : len(bvh.joints[0].channels)])
    translations, rotations = root.local_transforms()
    return mirror_poses(np.concatenate([DECIMETRE_M * translations[:, 0], rotations[:, 0]], axis=-1))


def _hand(path: Path, bvh: BvhMotion, side: str, subject: Hand) -> Fingers:
    """World joints and bone rotations; the tips, which the files lack, come from the `subject`."""
    names = [joint.name for joint in bvh.joints]
    expected, bones = subject.joint_names[: subject.bone_count], subject.bone_count
    if names != list(expected):
        raise TakeError(f"{path}: joints must be {' '.join(expected)}, found {' '.join(names)}")
    translations, rotations = bvh.local_transforms()
    translations, local = DECIMETRE_M * mirror_points(translations), mirror_quats(rotations)
    tips = subject.offsets[bones:] if side == "right" else mirror_points(subject.offsets[bones:])
    positions = np.empty((len(local), subject.joint_count, 3))
    world = np.empty((len(local), bones, 4))
    positions[:, 0], world[:, 0] = translations[:, 0], local[:, 0]
    for j, parent in enumerate(subject.parents[1:], start=1):
        offset = translations[:, j] if j < bones else tips[j - bones]
        positions[:, j] = positions[:, parent] + quat_rotate(world[:, parent], offset)
        if j < bones:
            world[:, j] = quat_multiply(world[:, parent], local[:, j])
    return Fingers(positions, world)
