"""From the network's outputs to a hand: bone axes to hinge angles, a light smoothing, the predicted distances."""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel, stack_array
from manipnet.synthesis.hand.hand import MAX_JOINTS, Hand, Indices, Skeleton
from manipnet.synthesis.hand.kinematics import angles_from_rotations_into
from manipnet.synthesis.hand.packed import unpack_skeleton
from manipnet.synthesis.model.layout import OUTPUT_DISTANCE_MAX_M, OutputColumns, layout_of
from manipnet.synthesis.rotations import set_identity

_distances, _rotations = stack_array(MAX_JOINTS), stack_array(MAX_JOINTS, 3, 3)


@inner
def unpack_output_columns(starts: Indices):
    """The first columns of the output blocks, from `Layout.output_starts`."""
    return OutputColumns(starts[0], starts[1], starts[2])


@inner
def _rotations_into(output: Array, first_column: int, rotations: Array, bones: int):
    """Rotations `(B, 3, 3)` from the two axes per bone, by Gram and Schmidt; the wrist is the frame itself."""
    set_identity(rotations[0])
    for bone in range(1, bones):
        r = rotations[bone]
        for i in range(3):
            for column in range(2):
                r[i, column] = output[first_column + 6 * bone + 3 * column + i]
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
def decode_into(
    skeleton: Skeleton,
    columns: OutputColumns,
    output: Array,
    before: Array,
    response: float,
    limits: Array,
    rotations: Array,
    angles: Array,
    distances: Array,
):
    """Decode one hand's `output` into `angles (A,)` and `distances (J,)` in metres.

    The angles go a share `response` of the way from `before (A,)` to the network's, inside `limits (A, 2)`.
    `rotations (B, 3, 3)` is working memory.
    """
    _rotations_into(output, columns.joint_axes, rotations, len(skeleton.rest))
    angles_from_rotations_into(skeleton, rotations, angles)
    for angle in range(len(limits)):
        value = before[angle] + response * (angles[angle] - before[angle])
        angles[angle] = min(max(value, limits[angle, 0]), limits[angle, 1])
    for joint in range(len(skeleton.parents)):
        distances[joint] = min(max(output[columns.distances + joint], 0.0), OUTPUT_DISTANCE_MAX_M)


@kernel
def _decode_batch(hand: np.ndarray, starts: Indices, outputs: Array, limits: Array, angles: Array):
    skeleton, columns = unpack_skeleton(hand), unpack_output_columns(starts)
    distances, rotations = _distances(), _rotations()
    for n in range(len(outputs)):
        decode_into(skeleton, columns, outputs[n], limits[:, 0], 1.0, limits, rotations, angles[n], distances)


def angles_from_outputs(hand: Hand, outputs: Array, limits: Array) -> Array:
    """The angles `(N, A)` inside `limits (A, 2)` of network outputs `(N, output_size)`, without smoothing."""
    angles = np.empty((len(outputs), hand.angle_count))
    _decode_batch(hand.packed, layout_of(hand).output_starts, outputs, limits, angles)
    return angles
