"""Recording of the shown motion, which is written as keyframes at the end: one action for the armature."""

import bpy
import numpy as np


class Recording:
    """The rotations of all bones over time, and the locations of the bones `moved`.

    `add` is cheap; `write` makes all keyframes at once, one per scene frame.
    """

    def __init__(self, armature: bpy.types.Object, bone_names: list[str], moved: list[str]) -> None:
        self._armature, self._bone_names, self._moved = armature, bone_names, moved
        self._times: list[float] = []
        self._rotations: list[np.ndarray] = []
        self._locations: list[np.ndarray] = []

    def __len__(self) -> int:
        return len(self._times)

    def add(self, time_s: float, rotations: np.ndarray, locations: np.ndarray) -> None:
        """Add `rotations (bones, 4)` wxyz and `locations (moved, 3)` of an instant that is later than the last one."""
        if not self._times or time_s > self._times[-1]:
            self._times.append(time_s)
            self._rotations.append(rotations)
            self._locations.append(locations)

    def write(self, first_frame: int, fps: float) -> int:
        """Write the recording as an action of the armature from `first_frame` on; returns the number of frames."""
        if len(self._times) < 2:
            return 0
        times = np.array(self._times) - self._times[0]
        frames = np.arange(int(times[-1] * fps) + 1)
        curves = _new_curves(self._armature)
        for names, channel_name, values in (
            (self._bone_names, "rotation_quaternion", self._rotations_at(times, frames / fps)),
            (self._moved, "location", _resampled(np.array(self._locations), times, frames / fps)),
        ):
            for i, name in enumerate(names):
                path = f'pose.bones["{bpy.utils.escape_identifier(name)}"].{channel_name}'
                for channel in range(values.shape[-1]):
                    _fill(curves.new(path, index=channel), first_frame + frames, values[:, i, channel])
                self._armature.pose.bones[name].rotation_mode = "QUATERNION"
        return len(frames)

    def _rotations_at(self, times: np.ndarray, at: np.ndarray) -> np.ndarray:
        """The rotations `(T, bones, 4)`, interpolated at the times `at (T,)`."""
        rotations = np.array(self._rotations)
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


def _new_curves(armature: bpy.types.Object):
    """The F-curves of a new action of the armature, in a slot if Blender has slots (since 4.4)."""
    action = bpy.data.actions.new("ManipNet")
    data = armature.animation_data or armature.animation_data_create()
    data.action = action
    if not hasattr(action, "slots"):
        return action.fcurves
    slot = action.slots.new(id_type="OBJECT", name=armature.name)
    data.action_slot = slot
    strip = action.layers.new("ManipNet").strips.new(type="KEYFRAME")
    return strip.channelbag(slot, ensure=True).fcurves


def _fill(curve, frames: np.ndarray, values: np.ndarray) -> None:
    curve.keyframe_points.add(len(frames))
    curve.keyframe_points.foreach_set("co", np.column_stack([frames, values]).ravel())
    curve.update()
