"""Recordings of the shown motion, and the keyframes that they become.

A take never changes an action that the extension did not make: each take is a new action with a fake user, in an NLA
track of its own. An action of the user that animates the same bones is pushed down to a track below, unchanged.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import bpy
import mathutils
import numpy as np

from .scene import Reference

TAKE = "ManipNet take"
LINEAR = 1
"""Blender's number for linear interpolation of keyframes."""


@dataclass(frozen=True)
class Bake:
    """Which keyframes a take gets: the first frame, the frames per second of the scene, and keys per second.

    `last_frame` ends the keyframes, if it is not None.
    """

    first_frame: float
    fps: float
    keys_per_second: float
    last_frame: float | None = None


class Track:
    """The motion of one object over time: of the bones `rotated` and `moved` of an armature, or of the object itself.

    An empty name stands for the object itself.
    """

    def __init__(self, target: Reference, rotated: Sequence[str], moved: Sequence[str]) -> None:
        self.target, self.rotated, self.moved = target, tuple(rotated), tuple(moved)
        found = target.find()
        self.modes = [_target(found, name).rotation_mode for name in rotated] if found else []
        self._times: list[float] = []
        self._rotations: list[np.ndarray] = []
        self._locations: list[np.ndarray] = []

    def __len__(self) -> int:
        return len(self._times)

    def add(self, time_s: float, rotations: np.ndarray, locations: np.ndarray) -> None:
        """Add `rotations (rotated, 4)` wxyz and `locations (moved, 3)` of a later instant than before."""
        if not self._times or time_s > self._times[-1]:
            self._times.append(time_s)
            self._rotations.append(rotations)
            self._locations.append(locations.reshape(-1, 3))

    def curves(self, start_s: float, bake: Bake) -> tuple[np.ndarray, dict[tuple[str, str, int], np.ndarray]]:
        """The frames `(F,)` of the keyframes and, by bone, property and index, their values `(F,)`.

        `start_s` is the instant of the bake's first frame.
        """
        times = np.array(self._times) - start_s
        step_s = 1.0 / (bake.keys_per_second or bake.fps)
        at = np.arange(math.ceil(times[0] / step_s - 1e-6), math.floor(times[-1] / step_s + 1e-6) + 1) * step_s
        frames = bake.first_frame + at * bake.fps
        if bake.last_frame is not None:
            at, frames = at[frames <= bake.last_frame + 1e-6], frames[frames <= bake.last_frame + 1e-6]
        out: dict[tuple[str, str, int], np.ndarray] = {}
        rotations = _rotations_at(np.array(self._rotations), times, at)
        for i, (name, mode) in enumerate(zip(self.rotated, self.modes, strict=True)):
            path, values = _channels(mode, rotations[:, i])
            out |= {(name, path, channel): values[:, channel] for channel in range(values.shape[1])}
        locations = _resampled(np.array(self._locations), times, at)
        for i, name in enumerate(self.moved):
            out |= {(name, "location", channel): locations[:, i, channel] for channel in range(3)}
        return frames, out


class Recording:
    """The tracks of everything that is recorded together. `labels` are stored with the actions."""

    def __init__(self, labels: dict[str, str | float]) -> None:
        self.tracks: list[Track] = []
        self.labels = labels

    def write(self, bake: Bake, attach: bool = True) -> int:
        """Make an action for each object that was recorded; returns the number of frames of the longest one.

        The actions become NLA tracks of their objects with `attach`, and where the objects still exist.
        """
        tracks = [track for track in self.tracks if len(track) > 1]
        if not tracks:
            return 0
        start_s = min(track._times[0] for track in tracks)
        by_name: dict[str, list[Track]] = {}
        for track in tracks:
            by_name.setdefault(track.target.name, []).append(track)
        return max(self._write_action(group, start_s, bake, attach) for group in by_name.values())

    def _write_action(self, tracks: list[Track], start_s: float, bake: Bake, attach: bool) -> int:
        baked = [track.curves(start_s, bake) for track in tracks]
        frames = np.concatenate([frames for frames, _ in baked])
        if not len(frames):
            return 0
        action = bpy.data.actions.new(f"{TAKE} {tracks[0].target.name}")
        action.use_fake_user = True
        for key, value in self.labels.items():
            action[key] = value
        if "timecode" in self.labels:
            action.pose_markers.new(str(self.labels["timecode"])).frame = round(bake.first_frame)
        new_curve, slot = _curve_maker(action, tracks[0].target.name)
        for at, values in baked:
            for (bone, path, channel), keys in values.items():
                _fill(new_curve(_data_path(bone, path), channel, bone or "Object Transforms"), at, keys)
        target = tracks[0].target.find() if attach else None
        if target is not None:
            paths = {_data_path(bone, path) for _, values in baked for bone, path, _ in values}
            add_strip(target, action, slot, paths)
        return round(float(frames.max() - frames.min())) + 1


def add_strip(target: bpy.types.Object, action: bpy.types.Action, slot: object, paths: Iterable[str]) -> None:
    """Show an action on an object by a strip in a new NLA track, on top of everything that it has already."""
    data = target.animation_data or target.animation_data_create()
    if data.use_tweak_mode:
        data.use_tweak_mode = False
    if data.action is not None and set(paths) & {curve.data_path for curve in action_curves(data)}:
        _push_down(data)
    if not data.nla_tracks:
        data.use_nla = True
    strip = _strip(data, action, slot)
    strip.extrapolation = "NOTHING"


def action_curves(data: bpy.types.AnimData) -> Iterable[bpy.types.FCurve]:
    """The F-curves of an object's own action; those of its slot, if Blender has slots (since 4.4)."""
    action = data.action
    if not hasattr(action, "slots"):
        return action.fcurves
    bags = (strip.channelbag(data.action_slot) for layer in action.layers for strip in layer.strips if data.action_slot)
    return [curve for bag in bags if bag for curve in bag.fcurves]


def _push_down(data: bpy.types.AnimData) -> None:
    """Turn the object's own action into an NLA strip that shows the same, as Blender's Push Down Action does."""
    action, scene = data.action, bpy.context.scene
    action.use_fake_user = True
    strip = _strip(data, action, getattr(data, "action_slot", None))
    start, end = action.frame_range
    strip.action_frame_start, strip.action_frame_end = min(start, scene.frame_start), max(end, scene.frame_end)
    strip.frame_start, strip.frame_end = strip.action_frame_start, strip.action_frame_end
    strip.blend_type, strip.influence = data.action_blend_type, data.action_influence
    strip.extrapolation = data.action_extrapolation
    data.action = None


def _strip(data: bpy.types.AnimData, action: bpy.types.Action, slot: object) -> bpy.types.NlaStrip:
    track = data.nla_tracks.new()
    track.name = action.name
    strip = track.strips.new(action.name, math.floor(action.frame_range[0]), action)
    strip.frame_start = action.frame_range[0]
    if slot is not None:
        strip.action_slot = slot
    return strip


def _curve_maker(action: bpy.types.Action, name: str) -> tuple[Callable[[str, int, str], bpy.types.FCurve], object]:
    """A function that makes an F-curve from data path, index and name of its group, and the action's slot, if any."""
    if not hasattr(action, "slots"):
        return lambda path, index, group: action.fcurves.new(path, index=index, action_group=group), None
    slot = action.slots.new(id_type="OBJECT", name=name)
    bag = action.layers.new(TAKE).strips.new(type="KEYFRAME").channelbag(slot, ensure=True)

    def new_curve(path: str, index: int, group: str) -> bpy.types.FCurve:
        curve = bag.fcurves.new(path, index=index)
        curve.group = bag.groups.get(group) or bag.groups.new(group)
        return curve

    return new_curve, slot


def _fill(curve: bpy.types.FCurve, frames: np.ndarray, values: np.ndarray) -> None:
    points = curve.keyframe_points
    points.add(len(frames))
    points.foreach_set("co", np.column_stack([frames, values]).ravel())
    points.foreach_set("interpolation", np.full(len(frames), LINEAR))
    curve.update()


def _target(found: bpy.types.Object, bone: str) -> bpy.types.Object | bpy.types.PoseBone:
    return found.pose.bones[bone] if bone else found


def _data_path(bone: str, path: str) -> str:
    return f'pose.bones["{bpy.utils.escape_identifier(bone)}"].{path}' if bone else path


def _channels(mode: str, rotations: np.ndarray) -> tuple[str, np.ndarray]:
    """The property that holds a rotation in a rotation mode, and its values for `rotations (T, 4)` wxyz."""
    if mode == "QUATERNION":
        return "rotation_quaternion", rotations
    quaternions = [mathutils.Quaternion(q) for q in rotations]
    if mode == "AXIS_ANGLE":
        return "rotation_axis_angle", np.array([(angle, *axis) for axis, angle in map(_axis_angle, quaternions)])
    angles = [quaternions[0].to_euler(mode)] if quaternions else []
    for each in quaternions[1:]:
        angles.append(each.to_euler(mode, angles[-1]))
    return "rotation_euler", np.array(angles).reshape(-1, 3)


def _axis_angle(rotation: mathutils.Quaternion) -> tuple[mathutils.Vector, float]:
    return rotation.to_axis_angle()


def _rotations_at(rotations: np.ndarray, times: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Rotations `(T, bones, 4)` wxyz at `times (T,)`, interpolated at the times `at`."""
    dots = np.sum(rotations[1:] * rotations[:-1], axis=-1)
    signs = np.cumprod(np.where(dots < 0.0, -1.0, 1.0), axis=0)
    rotations[1:] *= signs[..., None]
    out = _resampled(rotations, times, at)
    return out / np.linalg.norm(out, axis=-1, keepdims=True)


def _resampled(values: np.ndarray, times: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Values `(N, bones, channels)` at `times (N,)`, interpolated linearly at `at (T,)`."""
    out = np.empty((len(at), *values.shape[1:]))
    for index in np.ndindex(values.shape[1:]):
        out[(slice(None), *index)] = np.interp(at, times, values[(slice(None), *index)])
    return out
