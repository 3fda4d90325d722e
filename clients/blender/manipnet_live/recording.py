"""What was shown, as keyframes: collected while live, written in bulk at the end, one action per armature."""

import bpy
import numpy as np


class Recording:
    """Rotations of bones over time. `add` is cheap; `write` makes all keys at once, one per scene frame."""

    def __init__(self, armature: bpy.types.Object, bone_names: list[str]) -> None:
        self._armature, self._bone_names = armature, bone_names
        self._times: list[float] = []
        self._rotations: list[np.ndarray] = []

    def __len__(self) -> int:
        return len(self._times)

    def add(self, time_s: float, rotations: np.ndarray) -> None:
        """One instant: `rotations (bones, 4)` wxyz. Instants that do not rise are left out."""
        if not self._times or time_s > self._times[-1]:
            self._times.append(time_s)
            self._rotations.append(rotations)

    def write(self, first_frame: int, fps: float) -> int:
        """Make an action of it on the armature, from `first_frame` on; returns the number of frames."""
        if len(self._times) < 2:
            return 0
        frames, rotations = self._resampled(fps)
        curves = _new_curves(self._armature)
        for i, name in enumerate(self._bone_names):
            path = f'pose.bones["{bpy.utils.escape_identifier(name)}"].rotation_quaternion'
            for channel in range(4):
                _fill(curves.new(path, index=channel), first_frame + frames, rotations[:, i, channel])
            self._armature.pose.bones[name].rotation_mode = "QUATERNION"
        return len(frames)

    def _resampled(self, fps: float) -> tuple[np.ndarray, np.ndarray]:
        """Whole frames `(T,)` and the rotations at them `(T, bones, 4)`."""
        times = np.array(self._times) - self._times[0]
        rotations = np.array(self._rotations)
        dots = np.sum(rotations[1:] * rotations[:-1], axis=-1)
        signs = np.cumprod(np.where(dots < 0.0, -1.0, 1.0), axis=0)
        rotations[1:] *= signs[..., None]
        frames = np.arange(int(times[-1] * fps) + 1)
        flat = rotations.reshape(len(times), -1)
        out = np.stack([np.interp(frames / fps, times, column) for column in flat.T], axis=-1)
        out = out.reshape(len(frames), -1, 4)
        return frames, out / np.linalg.norm(out, axis=-1, keepdims=True)


def _new_curves(armature: bpy.types.Object):
    """The F-curves of a new action on the armature: in a slot where Blender has them (4.4 on)."""
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
