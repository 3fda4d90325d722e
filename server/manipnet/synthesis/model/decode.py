"""From the network's 220 outputs to a hand: bone axes to the 20 angles, a light smoothing, the predicted distances."""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel, stack_array
from manipnet.synthesis.hand.kinematics import angles_from_rotations_into, set_identity
from manipnet.synthesis.model.layout import OUTPUT, OUTPUT_DISTANCE_MAX_M

_distances, _rotations = stack_array(22), stack_array(17, 3, 3)
_AXES, _DISTANCES = OUTPUT["joint_axes"].start, OUTPUT["distances"].start


@inner
def _rotations_into(output, rotations):
    """Rotations `(17, 3, 3)` from the two axes per bone, by Gram and Schmidt; the wrist is the frame itself."""
    set_identity(rotations[0])
    for bone in range(1, 17):
        r = rotations[bone]
        for i in range(3):
            for column in range(2):
                r[i, column] = output[_AXES + 6 * bone + 3 * column + i]
        length = max(np.sqrt(r[0, 0] ** 2 + r[1, 0] ** 2 + r[2, 0] ** 2), 1e-9)
        along = 0.0
        for i in range(3):
            r[i, 0] /= length
            along += r[i, 0] * r[i, 1]
        length = 0.0
        for i in range(3):
            r[i, 1] -= along * r[i, 0]
            length += r[i, 1] ** 2
        length = max(np.sqrt(length), 1e-9)
        for i in range(3):
            r[i, 1] /= length
        r[0, 2] = r[1, 0] * r[2, 1] - r[2, 0] * r[1, 1]
        r[1, 2] = r[2, 0] * r[0, 1] - r[0, 0] * r[2, 1]
        r[2, 2] = r[0, 0] * r[1, 1] - r[1, 0] * r[0, 1]


@inner
def decode_into(output, before, response, limits, rotations, angles, distances):
    """One hand: `output (220,)` into `angles (20,)`, a share `response` of the way from `before (20,)` and inside
    `limits (20, 2)`, and `distances (22,)` in metres; `rotations (17, 3, 3)` is room to work in."""
    _rotations_into(output, rotations)
    angles_from_rotations_into(rotations, angles)
    for dof in range(20):
        angle = before[dof] + response * (angles[dof] - before[dof])
        angles[dof] = min(max(angle, limits[dof, 0]), limits[dof, 1])
    for j in range(22):
        distances[j] = min(max(output[_DISTANCES + j], 0.0), OUTPUT_DISTANCE_MAX_M)


@kernel
def _decode_batch(outputs, limits, angles):
    distances, rotations = _distances(), _rotations()
    for n in range(len(outputs)):
        decode_into(outputs[n], limits[:, 0], 1.0, limits, rotations, angles[n], distances)


def angles_from_outputs(outputs: Array, limits: Array) -> Array:
    """Angles `(N, 20)` inside `limits` that network outputs `(N, 220)` say, without smoothing."""
    angles = np.empty((len(outputs), 20))
    _decode_batch(outputs, limits, angles)
    return angles
