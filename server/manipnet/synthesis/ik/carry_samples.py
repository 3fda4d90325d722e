"""Where contact is compared on two hands: places on the avatar's, their counterparts on the model's, and their gaps."""

from typing import NamedTuple

from manipnet.geometry import Array
from manipnet.jit import inner
from manipnet.synthesis.hand.hand import Indices
from manipnet.synthesis.objects.distance_field import Field, field_distance
from manipnet.synthesis.sensing.scene import map_direction_back, map_point

MAX_SAMPLES = 128
REACH_M = 0.025
"""A counterpart that is farther from the object than this is free."""
TOUCHING_M, FREE_M = 0.003, 0.012
"""Up to the first gap a sample of the model's hand touches, beyond the second it is free of the object."""
TOUCHING_SHARE = 0.65
"""Samples that touch are to have this share of the gap, or depth, of their counterparts, so that none is lost."""


class Samples(NamedTuple):
    """Places on the avatar's hand and their counterparts on the model's, sorted by finger; those of the palm are last.

    A place is `joint + fraction · (end − joint) + R_bone · offset`, a `radius` away from the skin.
    """

    first: Indices
    """`(F + 2,)` where the samples of each finger begin, then those of the palm, then the end."""
    joints: Indices
    """`(S, 4)` start and end joint on the avatar, start and end joint on the model."""
    fractions: Array
    """`(S, 2)` on the avatar and on the model."""
    offsets: Array
    """`(S, 2, 3)` in the frame of the start joint's bone."""
    radii: Array
    """`(S, 2)`"""
    weights: Array
    """`(S,)`"""
    pads: Indices
    """`(F,)` the sample that is the pad of each finger."""


@inner
def wanted_gap(gap: float):
    """The gap that the avatar's sample is to have where its counterpart has `gap`: touching ones go nearer to zero."""
    if gap <= 0.0:
        return TOUCHING_SHARE * gap
    free = min(max((gap - TOUCHING_M) / (FREE_M - TOUCHING_M), 0.0), 1.0)
    return gap * (TOUCHING_SHARE + (1.0 - TOUCHING_SHARE) * free * free * (3.0 - 2.0 * free))


@inner
def place_sample(samples: Samples, s: int, which: int, positions: Array, rotations: Array, out: Array):
    """Sample `s` of the avatar (`which` 0) or of the model (1), in the wrist frame, into `out (3,)`."""
    start, end = samples.joints[s, 2 * which], samples.joints[s, 2 * which + 1]
    fraction, offset = samples.fractions[s, which], samples.offsets[s, which]
    for i in range(3):
        out[i] = positions[start, i] + fraction * (positions[end, i] - positions[start, i])
        out[i] += rotations[start, i, 0] * offset[0] + rotations[start, i, 1] * offset[1]
        out[i] += rotations[start, i, 2] * offset[2]


@inner
def field_at(field: Field, rotation: Array, translation: Array, scale: float, point: Array, normal: Array):
    """The distance of a point of the wrist frame to the object; the direction away from it into `normal (3,)`."""
    x, y, z = map_point(rotation, translation, scale, point[0], point[1], point[2])
    distance, gx, gy, gz = field_distance(field, x, y, z)
    normal[0], normal[1], normal[2] = map_direction_back(rotation, gx, gy, gz)
    return distance * scale
