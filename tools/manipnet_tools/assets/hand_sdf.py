"""The shape of the hand as a signed distance: tapered capsules around the bones, blended into a palm and a thumb web.

Everything is in the wrist frame of a right hand in the bind pose, metres. The fingers are blended into the palm but not
into one another. Radii follow the capsules of the dataset's subject where objects are touched. The tips are slimmer
than their capsules and lie behind the tip joints, because on captured grasps the tip joints lie on the pads and not
inside the finger.
"""

from dataclasses import dataclass

import numpy as np

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand

_BLEND_PALM_M = 2.5e-3
_BLEND_FINGER_M = 0.8e-3

_FINGER_RADII_MM = (
    # at each joint from the root to the tip; for the thumb, from the metacarpal end of its MCP joint
    (14.5, 11.2, 9.2, 6.6),
    (11.4, 9.7, 8.6, 6.2),
    (11.6, 10.0, 9.0, 6.8),
    (11.0, 9.5, 8.5, 6.4),
    (9.6, 8.3, 7.4, 5.4),
)
_TIP_BACK_MM = (4.5, 3.6, 3.0, 3.0, 3.4)
"""Distance from the tip joint to the centre of a fingertip, toward the back of the hand."""

# start xyz, end xyz and radii in millimetres: the flesh of the palm that belongs to no single bone
_WRIST_FLESH = (
    ((-24, 11, -3), (8, 12, -3), 16, 16),  # radial and ulnar side of the wrist
    ((-24, -11, -3), (8, -12, -3), 16, 15),
    ((10, -16, -9), (66, -35, -13), 16, 12.5),  # hypothenar
    ((18, 2, -9), (78, 3, -8), 13, 10),  # hollow of the palm
)
_THENAR_FLESH = (((30, 13, -13), (66, 33, -29), 15, 15.5),)
_WEB_FLESH = (((52, 29, -19), (90, 25, -6), 12, 8.5),)


@dataclass(frozen=True)
class Cone:
    """A tapered capsule of a `bone`: the hull of a sphere of radius `ra` at `a` and one of radius `rb` at `b`."""

    bone: int
    a: Array
    b: Array
    ra: float
    rb: float

    def distance(self, points: Array) -> Array:
        """Exact signed distance at points `(n, 3)`. Source: Quilez, "Round cone"."""
        axis = self.b - self.a
        length2 = axis @ axis
        taper = self.ra - self.rb
        a2 = length2 - taper * taper
        relative = points - self.a
        y = relative @ axis
        z = y - length2
        offset = relative * length2 - axis * y[:, None]
        x2 = np.sum(offset * offset, axis=1)
        y2, z2 = y * y * length2, z * z * length2
        k = np.sign(taper) * taper * taper * x2
        beyond_b = np.sign(z) * a2 * z2 > k
        before_a = np.sign(y) * a2 * y2 < k
        side = (np.sqrt(x2 * a2 / length2) + y * taper) / length2 - self.ra
        at_b = np.sqrt(x2 + z2) / length2 - self.rb
        at_a = np.sqrt(x2 + y2) / length2 - self.ra
        return np.where(beyond_b, at_b, np.where(before_a, at_a, side))


@dataclass(frozen=True)
class HandShape:
    """The cones of the palm, with the thenar, and of each finger."""

    palm: tuple[Cone, ...]
    fingers: tuple[tuple[Cone, ...], ...]

    def distance(self, points: Array) -> Array:
        """Signed distance of the whole hand at points `(n, 3)`."""
        palm = [cone.distance(points) for cone in self.palm]
        chains = [_smooth_minimum([c.distance(points) for c in chain], _BLEND_FINGER_M) for chain in self.fingers]
        return np.min([_smooth_minimum([*palm, chain], _BLEND_PALM_M) for chain in chains], axis=0)

    def bone_distances(self, points: Array) -> Array:
        """Signed distance to the flesh of each bone, `(n, 17)`; infinite for bone 1, which has no flesh of its own."""
        cones = [*self.palm, *(cone for chain in self.fingers for cone in chain)]
        distances = np.full((len(points), 17), np.inf)
        for cone in cones:
            distances[:, cone.bone] = np.minimum(distances[:, cone.bone], cone.distance(points))
        return distances


def bind_shape(hand: Hand, joints: Array, rotations: Array) -> HandShape:
    """The flesh around the `joints (J, 3)` and bones (`rotations (B, 3, 3)`) of the dataset's subject."""
    palm = [_cone_mm(0, *flesh) for flesh in (*_WRIST_FLESH, *_WEB_FLESH)]
    palm += [_cone_mm(2, *flesh) for flesh in _THENAR_FLESH]
    palm += [_metacarpal(joints[chain[0]], k) for k, chain in enumerate(hand.fingers[1:])]
    fingers = tuple(_chain(hand, joints, rotations, f) for f in range(5))
    return HandShape(tuple(palm), fingers)


def palmar_directions(hand: Hand, joints: Array, rotations: Array) -> Array:
    """Unit directions `(B, 3)` out of the palm side of each bone, toward which flexion moves it."""
    directions = np.tile([0.0, 0.0, -1.0], (hand.bone_count, 1))
    for angle, bone in reversed(list(enumerate(hand.angle_bones))):
        child = int(np.argmax(bone == hand.parents))
        axis = rotations[hand.parents[bone]] @ hand.axes[angle]
        along = joints[child] - joints[bone]
        directions[bone] = np.cross(axis, along)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _chain(hand: Hand, joints: Array, rotations: Array, finger: int) -> tuple[Cone, ...]:
    chain = list(hand.fingers[finger][-4:])
    centres = joints[chain].copy()
    bone = chain[-2]
    palmar = palmar_directions(hand, joints, rotations)[bone]
    along = centres[3] - centres[2]
    along /= np.linalg.norm(along)
    centres[3] -= 1e-3 * _TIP_BACK_MM[finger] * (palmar + 0.6 * along)
    radii = 1e-3 * np.array(_FINGER_RADII_MM[finger])
    return tuple(Cone(chain[k], centres[k], centres[k + 1], radii[k], radii[k + 1]) for k in range(3))


def _metacarpal(mcp: Array, k: int) -> Cone:
    start = 1e-3 * np.array([(12.0, 13.0, -3.0), (12.0, 5.0, -2.0), (12.0, -5.0, -2.0), (10.0, -13.0, -4.0)][k])
    end = mcp + 1e-3 * np.array([-3.0, 0.0, -3.0])
    return Cone(0, start, end, 14.5e-3, 1e-3 * (12.0, 12.5, 12.0, 10.5)[k])


def _cone_mm(bone: int, a: tuple, b: tuple, ra: float, rb: float) -> Cone:
    return Cone(bone, 1e-3 * np.array(a, dtype=float), 1e-3 * np.array(b, dtype=float), 1e-3 * ra, 1e-3 * rb)


def _smooth_minimum(distances: list[Array], width: float) -> Array:
    """Smooth minimum of `(n,)` arrays that blends over about `width` metres."""
    stack = np.stack(distances)
    low = stack.min(axis=0)
    return low - width * np.log(np.sum(np.exp((low - stack) / width), axis=0))
