"""Animations for export: hands and objects over time, from recordings, synthesised files and captured takes."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from manipnet.geometry import Array, Side, mirror_points, quat_conjugate, quat_multiply, quat_rotate
from manipnet.recording.mcap_file import read_hands
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.objects.mesh import ClosedMesh, closed_mesh
from manipnet.tracking.tick import TICK_HZ
from manipnet.wire import SIDES, HandsMessage
from manipnet_tools.takes.meshes import recorded_meshes
from manipnet_tools.takes.take import BodyTrack, last_tracked, read_take
from manipnet_tools.takes.timecode_track import TimecodeTrack, timecode_of

PAUSE_S = 10.0
"""A recording is split where its sender's time jumps back, or forward by more than this."""


class ExportError(ValueError):
    """Something cannot be exported; the text says why and what to do."""


@dataclass(frozen=True)
class HandTrack:
    """The motion of one hand over `T` frames. A left hand is not mirrored."""

    model: Hand
    """The hand whose skeleton it has, with `J` joints and `B` bones; only the lengths of the bones may differ."""
    wrist: Array
    """Poses `(T, 7)` in the world."""
    rotations: Array
    """Rotations `(T, B, 4)`: the wrist's in the world, and those of the other bones relative to their parent bones."""
    offsets: Array
    """Position `(J, 3)` of each joint in the frame of its parent bone, metres."""
    live: np.ndarray
    """`(T,)`, false where the hand was held or at rest because tracking was lost."""

    @property
    def scale(self) -> float:
        """Size relative to the model's hand."""
        return float(np.linalg.norm(self.offsets) / np.linalg.norm(self.model.offsets))

    def world(self) -> tuple[Array, Array]:
        """Joints `(T, J, 3)` and bone rotations `(T, B, 4)` in the world."""
        positions, rotations = np.empty((len(self.wrist), self.model.joint_count, 3)), self.rotations.copy()
        positions[:, 0] = self.wrist[:, :3]
        for joint, parent in enumerate(self.model.parents[1:], start=1):
            positions[:, joint] = positions[:, parent] + quat_rotate(rotations[:, parent], self.offsets[joint])
            if joint < self.model.bone_count:
                rotations[:, joint] = quat_multiply(rotations[:, parent], self.rotations[:, joint])
        return positions, rotations


@dataclass(frozen=True)
class Animation:
    """Hands by side and objects by name at `time_s (T,)`, right-handed, Y up, metres."""

    name: str
    rate_hz: float
    time_s: Array
    hands: dict[Side, HandTrack]
    objects: dict[str, BodyTrack] = field(default_factory=dict)
    meshes: dict[str, ClosedMesh] = field(default_factory=dict)
    """The meshes of the objects whose shape is known."""
    timecode: TimecodeTrack | None = None
    """If the tracker sent one."""
    avatar_joints: dict[Side, Array] = field(default_factory=dict)
    """The OpenXR joints `(T, 26, 7)` of an avatar's hands, if the source has them; it does not say of which avatar."""


def read_animation(path: Path, model: Hand, actor: str | None = None) -> Animation:
    """Read an animation of the hand `model` from a recording, a file of `manipnet synthesize`, or a take.

    `actor` chooses whose hands are read from a recording; by default they are those of its first actor. Raises
    `ExportError`, `TakeError`, `RecordingError` and `MeshError`.
    """
    suffix = path.suffix.lower()
    if suffix == ".npz":
        return _read_synthesised(path, model)
    if suffix == ".mcap" and path.is_file():
        return _read_recording(path, model, actor)
    take = read_take(path)
    if not take.fingers:
        raise _no_fingers(path, take.objects)
    hands: dict[Side, HandTrack] = {
        side: hand_track(model, take.fingers[side].positions, take.fingers[side].rotations) for side in SIDES
    }
    return Animation(take.name, take.rate_hz, take.time_s, hands, {name: take.bodies[name] for name in take.objects})


def hand_track(model: Hand, positions: Array, rotations: Array) -> HandTrack:
    """A track from joints `(T, J, 3)` and bone rotations `(T, B, 4)` in the world."""
    local = rotations.copy()
    local[:, 1:] = quat_multiply(quat_conjugate(rotations[:, model.parents[1 : model.bone_count]]), rotations[:, 1:])
    offsets = np.zeros((model.joint_count, 3))
    parents = model.parents[1:]
    along = positions[:, 1:] - positions[:, parents]
    offsets[1:] = np.median(quat_rotate(quat_conjugate(rotations[:, parents]), along), axis=0)
    wrist = np.concatenate([positions[:, 0], rotations[:, 0]], axis=1)
    return HandTrack(model, wrist, local, offsets, np.ones(len(wrist), dtype=np.bool_))


def _no_fingers(path: Path, objects: Iterable[str]) -> ExportError:
    mesh = next(iter(objects), "NAME")
    return ExportError(
        f"{path}: holds no fingers; make them first: manipnet synthesize {path} --mesh {mesh}=FILE --out fingers.npz, "
        "then export fingers.npz"
    )


def _read_synthesised(path: Path, model: Hand) -> Animation:
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
        time_s = arrays["time"]
        hands: dict[Side, HandTrack] = {
            side: hand_track(model, arrays[f"{side}_positions"], arrays[f"{side}_rotations"]) for side in SIDES
        }
    except OSError as error:
        raise ExportError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (KeyError, ValueError, BadZipFile) as error:
        raise ExportError(f"{path}: is not a file of `manipnet synthesize` ({error}); make it again") from None
    seen = np.ones(len(time_s), dtype=np.bool_)
    objects, meshes = {}, {}
    for k, name in enumerate(arrays.get("objects", np.empty(0, str)).tolist()):
        objects[name] = BodyTrack(arrays["object_poses"][k], seen)
        if f"object_{k}_faces" in arrays:
            meshes[name] = closed_mesh(arrays[f"object_{k}_vertices"], arrays[f"object_{k}_faces"], name)
    joints = {side: arrays[name] for side in SIDES if (name := f"{side}_hand_joints") in arrays}
    return Animation(path.stem, TICK_HZ, time_s, hands, objects, meshes, timecode_of(arrays), joints)


def _read_recording(path: Path, model: Hand, actor: str | None) -> Animation:
    messages = list(read_hands(path))
    actors = dict.fromkeys(message.actor for message in messages)
    if not messages:
        raise _no_fingers(path, read_take(path).objects)
    if actor is not None and actor not in actors:
        raise ExportError(f"{path}: no actor {actor!r}; it has {', '.join(actors)}")
    run = _longest_run([message for message in messages if message.actor == (actor or next(iter(actors)))])
    ticks = np.array([round((message.t_capture - run[0].t_capture) * TICK_HZ) for message in run])
    rows = {tick: message for tick, message in zip(ticks.tolist(), run, strict=True)}
    frames = [rows.get(tick) for tick in range(ticks[-1] + 1)]
    hands: dict[Side, HandTrack] = {
        side: track for side in SIDES if (track := _recorded_hand(model, frames, side)) is not None
    }
    if not hands:
        raise ExportError(f"{path}: its messages contain no hand, probably because no wrist was tracked")
    names = dict.fromkeys(body.name for message in run for body in message.bodies if not body.name.endswith("_wrist"))
    objects = {name: _recorded_body(frames, name) for name in names}
    meshes = {name: mesh for name, mesh in recorded_meshes(path).items() if name in objects}
    timecode = TimecodeTrack.of((None, None) if m is None else (m.timecode, m.timecode_rate) for m in frames)
    return Animation(path.stem, TICK_HZ, np.arange(len(frames)) / TICK_HZ, hands, objects, meshes, timecode)


def _longest_run(messages: list[HandsMessage]) -> list[HandsMessage]:
    runs = [messages[:1]]
    for before, message in pairwise(messages):
        step_s = message.t_capture - before.t_capture
        if before.session != message.session or not -1.0 / TICK_HZ < step_s < PAUSE_S:
            runs.append([])
        runs[-1].append(message)
    return max(runs, key=len)


def _recorded_hand(model: Hand, frames: list[HandsMessage | None], side: Side) -> HandTrack | None:
    poses = [None if message is None else message.hands.get(side) for message in frames]
    there = np.array([pose is not None for pose in poses])
    if not there.any():
        return None
    shown = [poses[k] for k in last_tracked(there)]
    hands = [hand for hand in shown if hand is not None]
    rotations = np.stack([hand.rotations for hand in hands])
    wrist = np.stack([hand.wrist for hand in hands])
    rotations[:, 0] = wrist[:, 3:]
    scale = float(np.median([hand.scale for hand in hands]))
    offsets = scale * (model.offsets if side == "right" else mirror_points(model.offsets))
    live = there & np.array([hand.state == "live" for hand in hands])
    return HandTrack(model, wrist, rotations, offsets, live)


def _recorded_body(frames: list[HandsMessage | None], name: str) -> BodyTrack:
    bodies = [next((b for b in message.bodies if b.name == name), None) if message else None for message in frames]
    there = np.array([body is not None for body in bodies])
    poses = np.stack([body.pose if body is not None else np.zeros(7) for body in bodies])[last_tracked(there)]
    return BodyTrack(poses, np.array([body is not None and body.tracked for body in bodies]))
