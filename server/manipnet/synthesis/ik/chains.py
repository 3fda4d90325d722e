"""What the solvers share: which angles turn a bone, limits, and a finger's capsules beside the object."""

from typing import NamedTuple

from manipnet.geometry import Array
from manipnet.jit import inner
from manipnet.synthesis.hand.hand import Chains, Indices
from manipnet.synthesis.objects.distance_field import Field, field_distance
from manipnet.synthesis.sensing.scene import map_point


@inner
def angle_moves(angle_bones: Indices, angle, bone):
    """Whether an angle turns `bone`, which is of the same finger."""
    return angle_bones[angle] <= bone


@inner
def clamp(value, limits: Array, angle):
    """`value` inside the limits `(A, 2)` of an angle."""
    return min(max(value, limits[angle, 0]), limits[angle, 1])


class Surface(NamedTuple):
    """The object's distance field as the wrist sees it (`sensing.scene.object_from_wrist`)."""

    field: Field
    rotation: Array
    """`(3, 3)`"""
    translation: Array
    """`(3,)`"""
    scale: float


@inner
def capsule_sample(chains: Chains, capsule: int, fraction: float, positions: Array, surface: Surface):
    """A point a `fraction` along the axis of a capsule, and the object's field there.

    Returns `(x, y, z, distance, gx, gy, gz)`: the point in the wrist frame, its signed distance in metres, and the
    field's gradient in the object's frame.
    """
    start, end, scale = chains.starts[capsule], chains.ends[capsule], surface.scale
    x = positions[start, 0] + fraction * (positions[end, 0] - positions[start, 0])
    y = positions[start, 1] + fraction * (positions[end, 1] - positions[start, 1])
    z = positions[start, 2] + fraction * (positions[end, 2] - positions[start, 2])
    px, py, pz = map_point(surface.rotation, surface.translation, scale, x, y, z)
    distance, gx, gy, gz = field_distance(surface.field, px, py, pz)
    return x, y, z, distance * scale, gx, gy, gz
