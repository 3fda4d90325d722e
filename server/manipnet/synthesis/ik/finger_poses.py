"""Poses of one finger that touch the object, nearest to its present pose first."""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner
from manipnet.synthesis.hand.hand import CHAIN_LENGTH, Chains, Skeleton
from manipnet.synthesis.hand.kinematics import pose_finger_into
from manipnet.synthesis.ik.chains import Surface, capsule_sample, clamp
from manipnet.synthesis.ik.contacts import TOUCH_M

MOST_POSES = 12
_MOST_DEPTH_M = 0.0025
_SAMPLES = 5
_NEARBY_RAD = 0.6
"""The nearby search goes this far from the present angles."""
_STRETCHED_RAD = -0.3
"""The wide search goes over the whole range of an angle, but not beyond this."""
_TOUCH_BONUS = 0.3
"""What a touching capsule takes off the cost of a pose, in square radians."""
_END_JOINT_SHARE = 0.6
"""The last joint of a finger bends with the middle one; a person cannot bend it alone."""


@inner
def _tried(reference, low, high, index, count, wide: bool):
    """Value `index` of the `count` to try for an angle: over its range, or about the reference, finest near it."""
    if count == 1:
        return reference
    if wide:
        low = max(low, _STRETCHED_RAD)
        return low + (high - low) * index / (count - 1.0)
    away = 2.0 * index / (count - 1.0) - 1.0
    reach = _NEARBY_RAD if count > 3 else 0.5 * _NEARBY_RAD
    return min(max(reference + reach * away * abs(away), low), high)


@inner
def _posture_cost(chains: Chains, finger: int, angles: Array, reference: Array):
    """How far a finger's `angles (A,)` are from the `reference (A,)`, in square radians; the last joint counts less."""
    cost = 0.0
    for k in range(CHAIN_LENGTH):
        a = chains.angles[finger, k]
        if a >= 0:
            weight = 1.5 if k == 1 else (0.3 if k == 3 else 1.0)
            cost += weight * (angles[a] - reference[a]) ** 2
    return cost


@inner
def _touch(chains: Chains, finger: int, positions: Array, surface: Surface):
    """The smallest gap of a finger's capsules and how many of them touch."""
    least, touching = np.inf, 0
    for k in range(CHAIN_LENGTH):
        c = chains.capsules[finger, k]
        if c < 0:
            continue
        gap = np.inf
        for s in range(_SAMPLES):
            gap = min(gap, capsule_sample(chains, c, s / (_SAMPLES - 1.0), positions, surface)[3])
        gap -= chains.radii[c]
        least = min(least, gap)
        touching += 1 if gap < TOUCH_M else 0
    return least, touching


@inner
def _keep(chains: Chains, finger: int, angles: Array, cost, found, costs: Array, poses: Array):
    """Insert a pose into the cheapest ones found so far; returns their number."""
    at = min(found, MOST_POSES - 1)
    while at > 0 and costs[at - 1] > cost:
        costs[at] = costs[at - 1]
        for k in range(CHAIN_LENGTH):
            poses[at, k] = poses[at - 1, k]
        at -= 1
    costs[at] = cost
    for k in range(CHAIN_LENGTH):
        a = chains.angles[finger, k]
        poses[at, k] = angles[a] if a >= 0 else 0.0
    return min(found + 1, MOST_POSES)


@inner
def touching_poses(
    skeleton: Skeleton,
    chains: Chains,
    limits: Array,
    surface: Surface,
    finger: int,
    wide: bool,
    reference: Array,
    angles: Array,
    positions: Array,
    rotations: Array,
    axes: Array,
    costs: Array,
    poses: Array,
):
    """The cheapest poses with which a finger touches the object, into `costs (K,)`, `poses (K, 4)`; returns how many.

    They are looked for about the `reference (A,)`, or `wide`: over the finger's whole range, so that it is also found
    behind a handle. `angles (A,)`, `positions (J, 3)`, `rotations (B, 3, 3)` and `axes (A, 3)` hold the posed hand and
    are changed in that finger only.
    """
    thumb, found = finger == 0, 0
    c0, c1, c2, c3 = chains.angles[finger]
    n0 = (5 if thumb else 9) if c0 >= 0 else 1
    n1 = (5 if thumb else 3) if c1 >= 0 else 1
    n2 = (5 if thumb else 9) if c2 >= 0 else 1
    n3 = 3 if thumb and c3 >= 0 else 1
    for number in range(n0 * n1 * n2 * n3):
        i0, i1, i2, i3 = number // (n1 * n2 * n3), number // (n2 * n3) % n1, number // n3 % n2, number % n3
        if c0 >= 0:
            angles[c0] = _tried(reference[c0], limits[c0, 0], limits[c0, 1], i0, n0, wide)
        if c1 >= 0:
            angles[c1] = _tried(reference[c1], limits[c1, 0], limits[c1, 1], i1, n1, wide)
        if c2 >= 0:
            angles[c2] = _tried(reference[c2], limits[c2, 0], limits[c2, 1], i2, n2, wide)
        if c3 >= 0 and thumb:
            angles[c3] = _tried(reference[c3], limits[c3, 0], limits[c3, 1], i3, n3, wide)
        elif c3 >= 0:
            bent = _END_JOINT_SHARE * angles[c2] if wide else reference[c3] + 0.5 * (angles[c2] - reference[c2])
            angles[c3] = clamp(bent, limits, c3)
        cost = _posture_cost(chains, finger, angles, reference)
        if found == MOST_POSES and cost - CHAIN_LENGTH * _TOUCH_BONUS >= costs[found - 1]:
            continue
        pose_finger_into(skeleton, chains, finger, angles, positions, rotations, axes)
        least, touching = _touch(chains, finger, positions, surface)
        cost -= _TOUCH_BONUS * touching
        if -_MOST_DEPTH_M < least < TOUCH_M and (found < MOST_POSES or cost < costs[found - 1]):
            found = _keep(chains, finger, angles, cost, found, costs, poses)
    return found
