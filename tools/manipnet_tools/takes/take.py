"""Takes: recorded bodies, with captured fingers where there are any, read from every supported file.

All are in the project frame: right-handed, Y up, metres, seconds, quaternions xyzw. Bodies `left_wrist` and
`right_wrist` are the wrist frames of `manipnet.synthesis.hand.hand`, the left one its mirror image.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import SIDES, Array
from manipnet.recording.mcap_file import RecordingError, read_bodies
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.synthesizer import hand_to_world
from manipnet.wire.bodies import BodyFrame
from manipnet_tools.takes.body_names import AmbiguousNameError, take_names
from manipnet_tools.takes.bvh_folder import read_bvh_folder
from manipnet_tools.takes.bvh_motion import BvhError
from manipnet_tools.takes.dataset import TAKE_FILE
from manipnet_tools.takes.motive_csv import read_motive_csv
from manipnet_tools.takes.motive_table import MotiveCsvError
from manipnet_tools.takes.take_file import TakeFileError, read_take_file
from manipnet_tools.takes.timecode_track import TimecodeTrack
from manipnet_tools.takes.trajectory import TrajectoryError, read_trajectory

TRACKED_FORMATS: Final = (".csv", ".mcap")
"""Formats of tracked bodies, whose up axis the sender chooses."""
RESTART_S: Final = 0.5
"""A time that goes back by this much means that the sender has started again."""


class TakeError(ValueError):
    """A take cannot be read; the text names the file, the place and what was expected."""


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
    timecode: TimecodeTrack | None = None
    """If the tracker sent one."""
    hand: Hand | None = None
    """The hand that the fingers are of, if the take has its own; otherwise that of the dataset's subject."""

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the bodies that are not wrists."""
        return tuple(name for name in self.bodies if name not in ("left_wrist", "right_wrist"))


def read_take(path: Path | str, keep: Collection[str] = (), up: Literal["y", "z"] = "y") -> Take:
    """Read a take: a folder of BVH files or of a generated take, a trajectory text, a Motive CSV or a recording.

    Bodies of a Motive CSV that are called like a wrist get its name, except for the names in `keep`. `up` is the axis
    that points up in a Motive CSV or a recording. Raises `TakeError`.
    """
    path = Path(path)
    if not path.exists():
        raise TakeError(f"{path}: no such take")
    kind = "folder" if path.is_dir() else path.suffix.lower()
    readers = {
        "folder": _read_folder,
        ".txt": _read_trajectory,
        ".csv": lambda path: _read_motive_csv(path, keep),
        ".mcap": _read_recording,
    }
    if kind not in readers:
        allowed = ", ".join(suffix for suffix in readers if suffix != "folder")
        raise TakeError(f"{path}: {_unknown(kind)}; allowed are a folder of BVH files, {allowed}")
    if up == "z" and kind not in TRACKED_FORMATS:
        raise TakeError(f"{path}: --up z is for {' and '.join(TRACKED_FORMATS)} files; this format has its own up axis")
    try:
        take = readers[kind](path)
    except (BvhError, TrajectoryError, MotiveCsvError, RecordingError, TakeFileError) as error:
        raise TakeError(str(error)) from None
    except (AmbiguousNameError, OSError) as error:
        raise TakeError(f"{path}: {error}") from None
    return _y_up(take) if up == "z" else take


def _unknown(suffix: str) -> str:
    """Why a file is not a take."""
    if suffix == ".bvh":
        return "a single BVH file is not a take; give its folder, with leftHand.bvh, rightHand.bvh and the objects"
    if suffix in (".fbx", ".c3d", ".tak"):
        return f"{suffix} files cannot be read; export the take from its program as CSV"
    return "unknown kind of take"


def _read_folder(folder: Path) -> Take:
    if (folder / TAKE_FILE).is_file():
        return _read_generated(folder)
    read = read_bvh_folder(folder)
    fingers = {side: Fingers(*hand) for side, hand in read.hands.items()}
    tracks = {
        f"{side}_wrist": np.concatenate([hand.positions[:, 0], hand.rotations[:, 0]], axis=-1)
        for side, hand in fingers.items()
    } | read.objects
    frames = len(tracks["left_wrist"])
    seen = np.ones(frames, dtype=np.bool_)
    bodies = {name: BodyTrack(poses, seen) for name, poses in tracks.items()}
    return Take(folder.name, read.rate_hz, np.arange(frames) / read.rate_hz, bodies, fingers)


def _read_generated(folder: Path) -> Take:
    take, hand = read_take_file(folder)
    seen = np.ones(len(take.object), dtype=np.bool_)
    tracks = {f"{side}_wrist": take.wrists[side] for side in SIDES} | {take.object_name: take.object}
    fingers = {}
    for side in SIDES:
        positions, rotations = hand_to_world(side, take.wrists[side], *forward_kinematics(hand, take.angles[side]))
        fingers[side] = Fingers(positions, rotations)
    bodies = {name: BodyTrack(poses, seen) for name, poses in tracks.items()}
    return Take(folder.name, take.rate_hz, np.arange(len(seen)) / take.rate_hz, bodies, fingers, hand=hand)


def _read_trajectory(path: Path) -> Take:
    rate_hz, poses = read_trajectory(path)
    time_s = np.arange(len(poses["object"])) / rate_hz
    seen = np.ones(len(time_s), dtype=np.bool_)
    bodies = {name: BodyTrack(track, seen) for name, track in poses.items()}
    return Take(path.stem, rate_hz, time_s, bodies, box_centred=True)


def _read_motive_csv(path: Path, keep: Collection[str]) -> Take:
    motive = read_motive_csv(path)
    names = take_names(motive.bodies, keep)
    bodies = {names[name]: BodyTrack(*track) for name, track in motive.bodies.items()}
    return Take(path.stem, motive.rate_hz, motive.time_s, bodies, timecode=motive.timecode)


def _y_up(take: Take) -> Take:
    """A take of tracked bodies whose world has Z up, turned to Y up as the server turns a stream of Motive.

    The axes of world and bodies are renamed alike: (x, y, z) becomes (x, z, -y), in rotations too.
    """
    axes, signs = [0, 2, 1, 3, 5, 4, 6], np.array([1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0])
    bodies = {name: replace(track, poses=signs * track.poses[:, axes]) for name, track in take.bodies.items()}
    return replace(take, bodies=bodies)


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
    rate_hz = round(1.0 / float(np.median(np.diff(time_s))), 3)
    timecode = TimecodeTrack.of((frame.timecode, frame.timecode_rate) for frame in frames)
    return Take(path.stem, rate_hz, time_s - time_s[0], _tracks(frames), timecode=timecode)


def _tracks(frames: Sequence[BodyFrame]) -> dict[str, BodyTrack]:
    """Tracks by name, or by id where a body has no name.

    A lost body stays where it was last, and before its first pose it is where it will be first.
    """
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
    """For each frame the last one at which a body was tracked; before that, the first one."""
    return np.maximum.accumulate(np.where(tracked, np.arange(len(tracked)), np.argmax(tracked)))
