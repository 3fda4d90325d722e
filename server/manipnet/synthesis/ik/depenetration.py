"""Fingers that went deep into the object are opened until they are out, so that the solver meets them from outside.

Deep inside, the nearest surface may be the far one: a solver that follows the field from there would push a finger
through the object. A thumb is left alone: there is no one direction that opens it.
"""

from manipnet.jit import inner, stack_array
from manipnet.synthesis.hand.kinematics import forward_kinematics_into
from manipnet.synthesis.ik.chains import CAPSULE_ENDS, CAPSULE_RADII, CAPSULE_STARTS, CAPSULES, DOFS, FINGERS, clamp
from manipnet.synthesis.objects.distance_field import field_distance
from manipnet.synthesis.sensing.scene import map_point

DEEP_M = 0.010
"""A capsule this deep is not pressed into the surface but on its way through the object."""
OPENINGS = 5
"""Steps from the pose to straight fingers."""
_SAMPLES = 3
_closed, _depths, _numbers = stack_array(20), stack_array(FINGERS), stack_array(FINGERS)


@inner
def _depth(finger, positions, field, rotation, translation, scale):
    """How deep the finger's capsules are in the object, metres."""
    deepest = -1.0
    for c in CAPSULES[finger]:
        start, end = CAPSULE_STARTS[c], CAPSULE_ENDS[c]
        for s in range(_SAMPLES):
            f = (s + 1.0) / _SAMPLES
            x = positions[start, 0] + f * (positions[end, 0] - positions[start, 0])
            y = positions[start, 1] + f * (positions[end, 1] - positions[start, 1])
            z = positions[start, 2] + f * (positions[end, 2] - positions[start, 2])
            px, py, pz = map_point(rotation, translation, scale, x, y, z)
            distance, _, _, _ = field_distance(field, px, py, pz)
            deepest = max(deepest, CAPSULE_RADII[c] - distance * scale)
    return deepest


@inner
def push_out_deep_fingers(angles, limits, field, rotation, translation, scale, positions, rotations, axes):
    """Straighten the fingers of `angles (20,)` that are `DEEP_M` deep until they are not, or as far as it helps.

    `positions (22, 3)`, `rotations (17, 3, 3)` and `axes (20, 3)` are room to work in.
    """
    closed, least, best = _closed(), _depths(), _numbers()
    for dof in range(len(angles)):
        closed[dof] = angles[dof]
    for step in range(OPENINGS + 1):
        share = step / OPENINGS
        for finger in range(1, FINGERS):
            if step > 0 and least[finger] > DEEP_M:
                for k in range(DOFS):
                    dof = DOFS * finger + k
                    angles[dof] = clamp((1.0 - share) * closed[dof], limits, dof)
        forward_kinematics_into(angles, positions, rotations, axes)
        stuck = False
        for finger in range(1, FINGERS):
            if step == 0 or least[finger] > DEEP_M:
                depth = _depth(finger, positions, field, rotation, translation, scale)
                if step == 0 or depth < least[finger]:
                    least[finger], best[finger] = depth, share
            stuck = stuck or least[finger] > DEEP_M
        if not stuck:
            break
    for finger in range(1, FINGERS):
        for k in range(DOFS):
            dof = DOFS * finger + k
            angles[dof] = clamp((1.0 - best[finger]) * closed[dof], limits, dof)
