"""A hand as a value: its skeleton, hinges, limits, capsules, skin and sensors.

Everything describes a **right** hand in its wrist frame: +x points to the fingers, +y to the thumb side, the palm faces
-z; lengths are metres. A left hand is its exact mirror image (`geometry.mirror_*`). At angle zero the hand is flat and
its fingers are straight along +x. Flexion toward the palm is positive, abduction toward the thumb is positive.

A hand with `J` joints has `B` bones, which are its first joints, and one fingertip per finger, which are its last. `A`
hinge angles turn the bones. Compiled code receives a hand as the named tuples `Skeleton`, `Chains` and `Sensors`; it is
cached on disk and would not notice another hand if one were compiled into it.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array, quat_to_matrix

Indices = NDArray[np.int64]

MAX_JOINTS: Final = 32
MAX_ANGLES: Final = 32
MAX_FINGERS: Final = 8
MAX_CAPSULES: Final = 32
MAX_SENSORS: Final = 256
"""The largest hand that compiled code has room for."""
CHAIN_LENGTH: Final = 4
"""Angles, moved joints and capsules that one finger has at most; the solvers' loops over a finger have this length."""


class Skeleton(NamedTuple):
    """Bones and hinges, for forward kinematics."""

    parents: Indices
    """`(J,)` parent bone of each joint, which comes before it; -1 for the wrist, joint 0."""
    offsets: Array
    """`(J, 3)` of each joint in its parent bone's frame."""
    rest: Array
    """`(B, 3, 3)` local rotation of each bone when its angles are zero."""
    angle_bones: Indices
    """`(A,)` the bone that each angle turns."""
    axes: Array
    """`(A, 3)` unit hinge axes in the parent bone's frame; a bone's second axis as its first angle has turned it."""
    first_angle: Indices
    """`(B,)` a bone's first angle."""
    angle_counts: Indices
    """`(B,)` how many angles turn a bone: none, one or two."""


class Chains(NamedTuple):
    """Fingers as chains of hinges, for the solvers: the wrist is fixed, so they are independent.

    Rows have `CHAIN_LENGTH` entries; -1 stands where a finger has fewer. The first finger is the thumb.
    """

    angles: Indices
    """`(F, 4)` from the root to the tip."""
    joints: Indices
    """`(F, 4)` joints that the angles move."""
    capsules: Indices
    """`(F, 4)`"""
    starts: Indices
    """`(C,)` joint at the start of each capsule of the hand."""
    ends: Indices
    """`(C,)`"""
    radii: Array
    """`(C,)`"""


class Skin(NamedTuple):
    """A closed mesh that follows the bones."""

    vertices: Array
    """`(V, 3)` in the wrist frame, in the pose of `bind_angles`."""
    faces: NDArray[np.int32]
    """`(N, 3)`, counter-clockwise from outside on a right hand."""
    bones: Indices
    """`(V, K)` the bones each vertex follows."""
    weights: Array
    """`(V, K)` how much it follows them; each row sums to one."""
    bind_angles: Array
    """`(A,)` radians."""


class Sensors(NamedTuple):
    """Where the hand senses: points of the skin for the proximity sensors, and the ambient sensor's grid."""

    bones: Indices
    """`(S, 2)` the bones each point follows."""
    weights: Array
    """`(S, 2)` how much it follows them; each row sums to one."""
    points: Array
    """`(S, 2, 3)` its position in the frame of each of its bones."""
    normals: Array
    """`(S, 2, 3)` the outward normal there."""
    grid_center: Array
    """`(3,)` centre of the ambient grid in the wrist frame."""


PACKED: Final = np.dtype(
    [
        *((count, "i8") for count in ("joints", "bones", "angles", "fingers", "capsules", "sensors")),
        ("parents", "i8", MAX_JOINTS),
        ("offsets", "f8", (MAX_JOINTS, 3)),
        ("rest", "f8", (MAX_JOINTS, 3, 3)),
        ("angle_bones", "i8", MAX_ANGLES),
        ("axes", "f8", (MAX_ANGLES, 3)),
        ("first_angle", "i8", MAX_JOINTS),
        ("angle_counts", "i8", MAX_JOINTS),
        ("chain_angles", "i8", (MAX_FINGERS, CHAIN_LENGTH)),
        ("chain_joints", "i8", (MAX_FINGERS, CHAIN_LENGTH)),
        ("chain_capsules", "i8", (MAX_FINGERS, CHAIN_LENGTH)),
        ("capsule_starts", "i8", MAX_CAPSULES),
        ("capsule_ends", "i8", MAX_CAPSULES),
        ("capsule_radii", "f8", MAX_CAPSULES),
        ("sensor_bones", "i8", (MAX_SENSORS, 2)),
        ("sensor_weights", "f8", (MAX_SENSORS, 2)),
        ("sensor_points", "f8", (MAX_SENSORS, 2, 3)),
        ("sensor_normals", "f8", (MAX_SENSORS, 2, 3)),
        ("grid_center", "f8", 3),
    ]
)
"""All that compiled code knows of a hand, in one array: every array more costs a call from Python 0.2 microseconds."""


@dataclass(frozen=True, eq=False)
class Hand:
    """One hand; read by `hand_file.read_hand`, which checks it."""

    name: str
    joint_names: tuple[str, ...]
    """Of the bones' joints, then of the fingertips, `J` in all."""
    parents: Indices
    """`(J,)`"""
    offsets: Array
    """`(J, 3)`"""
    rest_quats: Array
    """`(B, 4)` local rotation of each bone when its angles are zero, xyzw."""
    angle_names: tuple[str, ...]
    angle_bones: Indices
    """`(A,)`, rising."""
    axes: Array
    """`(A, 3)`"""
    limits: Array
    """`(A, 2)` lower and upper limit of each angle, radians."""
    fingers: tuple[tuple[int, ...], ...]
    """Joints of each finger from the root to the tip, the thumb's first."""
    capsules: Indices
    """`(C, 2)` start and end joint of each capsule."""
    radii: Array
    """`(C,)`"""
    skin: Skin
    sensors: Sensors

    @property
    def joint_count(self) -> int:
        """Bones and fingertips."""
        return len(self.parents)

    @property
    def bone_count(self) -> int:
        """Bones, the wrist's included."""
        return len(self.rest_quats)

    @property
    def angle_count(self) -> int:
        """Hinge angles."""
        return len(self.axes)

    @property
    def sensor_count(self) -> int:
        """Proximity sensors."""
        return len(self.sensors.bones)

    @cached_property
    def skeleton(self) -> Skeleton:
        """Bones and hinges as compiled code takes them."""
        counts = np.bincount(self.angle_bones, minlength=self.bone_count)
        first = np.searchsorted(self.angle_bones, np.arange(self.bone_count))
        rest = quat_to_matrix(self.rest_quats)
        return Skeleton(self.parents, self.offsets, rest, self.angle_bones, self.axes, first, counts)

    @cached_property
    def chains(self) -> Chains:
        """Fingers as compiled code takes them."""
        angles = [np.flatnonzero(np.isin(self.angle_bones, finger)) for finger in self.fingers]
        capsules = [np.flatnonzero(np.isin(self.capsules, finger).all(axis=1)) for finger in self.fingers]
        moved = [finger[1:] for finger in self.fingers]
        starts, ends = self.capsules.T.copy()
        return Chains(_padded(angles), _padded(moved), _padded(capsules), starts, ends, self.radii)

    @cached_property
    def packed(self) -> np.ndarray:
        """One `PACKED` record, `(1,)`: the hand as an argument of kernels, which unpack it (`packed`)."""
        packed, skeleton, chains, sensors = np.zeros(1, PACKED), self.skeleton, self.chains, self.sensors
        counts = self.joint_count, self.bone_count, self.angle_count, len(self.fingers), len(self.radii)
        values = [*counts, self.sensor_count, *skeleton, *chains, *sensors]
        for name, value in zip(PACKED.names or (), values, strict=True):
            if np.ndim(value) and name != "grid_center":
                packed[name][0, : len(value)] = value
            else:
                packed[name] = value
        packed.flags.writeable = False
        return packed

    @cached_property
    def finger_of_angle(self) -> Indices:
        """`(A,)` the finger that each angle belongs to."""
        owner = {joint: f for f, finger in enumerate(self.fingers) for joint in finger}
        return np.array([owner[bone] for bone in self.angle_bones.tolist()])


def _padded(rows: list) -> Indices:
    table = np.full((len(rows), CHAIN_LENGTH), -1)
    for row, values in zip(table, rows, strict=True):
        row[: len(values)] = values
    return table
