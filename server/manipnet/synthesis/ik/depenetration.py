"""Depenetration: fingers that went deep into the object are opened until they are out, before the solver moves them.

Deep inside, the nearest surface may be the far one, and a solver that follows the field from there would push a finger
through the object. The thumb is left alone, because no single direction opens it.
"""

from manipnet.geometry import Array
from manipnet.jit import inner, stack_array
from manipnet.synthesis.hand.hand import CHAIN_LENGTH, MAX_ANGLES, MAX_FINGERS, Chains, Skeleton
from manipnet.synthesis.hand.kinematics import forward_kinematics_into
from manipnet.synthesis.ik.chains import Surface, capsule_sample, clamp

DEEP_M = 0.010
"""A capsule this deep is not pressed into the surface but on its way through the object."""
STEPS = 5
"""Steps from the pose to straight fingers."""
_SAMPLES = 3
_closed, _depths, _shares = stack_array(MAX_ANGLES), stack_array(MAX_FINGERS), stack_array(MAX_FINGERS)


@inner
def _depth(
    chains: Chains,
    finger: int,
    positions: Array,
    surface: Surface,
):
    """How deep the finger's capsules are in the object, metres."""
    deepest = -1.0
    for k in range(CHAIN_LENGTH):
        c = chains.capsules[finger, k]
        if c < 0:
            continue
        for s in range(_SAMPLES):
            f = (s + 1.0) / _SAMPLES
            _, _, _, distance, _, _, _ = capsule_sample(chains, c, f, positions, surface)
            deepest = max(deepest, chains.radii[c] - distance)
    return deepest


@inner
def _open_finger(chains: Chains, finger: int, share: float, closed: Array, limits: Array, angles: Array):
    """Set a finger's `angles` a `share` of the way from `closed (A,)` to straight."""
    for k in range(CHAIN_LENGTH):
        angle = chains.angles[finger, k]
        if angle >= 0:
            angles[angle] = clamp((1.0 - share) * closed[angle], limits, angle)


@inner
def open_deep_fingers(
    skeleton: Skeleton,
    chains: Chains,
    angles: Array,
    limits: Array,
    surface: Surface,
    positions: Array,
    rotations: Array,
    axes: Array,
):
    """Straighten the fingers of `angles (A,)` that are `DEEP_M` deep until they are not, or as far as it helps.

    `positions (J, 3)`, `rotations (B, 3, 3)` and `axes (A, 3)` are working memory.
    """
    closed, least, best = _closed(), _depths(), _shares()
    fingers = len(chains.angles)
    for angle in range(len(angles)):
        closed[angle] = angles[angle]
    for step in range(STEPS + 1):
        share = step / STEPS
        for finger in range(1, fingers):
            if step > 0 and least[finger] > DEEP_M:
                _open_finger(chains, finger, share, closed, limits, angles)
        forward_kinematics_into(skeleton, angles, positions, rotations, axes)
        stuck = False
        for finger in range(1, fingers):
            if step == 0 or least[finger] > DEEP_M:
                depth = _depth(chains, finger, positions, surface)
                if step == 0 or depth < least[finger]:
                    least[finger], best[finger] = depth, share
            stuck = stuck or least[finger] > DEEP_M
        if not stuck:
            break
    for finger in range(1, fingers):
        _open_finger(chains, finger, best[finger], closed, limits, angles)
