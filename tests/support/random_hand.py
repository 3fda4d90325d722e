"""A hands message with one random hand, for tests of retargeting."""

from dataclasses import replace

import numpy as np
from make_vectors import messages
from manipnet_client.retarget import BONES

from manipnet.geometry import Side, matrix_to_quat, mirror_quats, quat_conjugate, quat_multiply
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.openxr import pose_in_world
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.wire import HandsMessage

HAND = shipped_hand()

ENDS = np.array([17 + i // 3 if i % 3 == 2 else 3 + i for i in range(15)])
"""The joint at which each finger bone of `BONES` ends."""


def posed(side: Side, rng: np.random.Generator) -> tuple[HandsMessage, np.ndarray]:
    """A message with one random hand, and the unit directions of its finger bones in the wrist frame `(15, 3)`."""
    angles = rng.uniform(*HAND.limits.T)
    positions, matrices = forward_kinematics(HAND, angles)
    world = matrix_to_quat(matrices)
    local = world.copy()
    local[1:] = quat_multiply(quat_conjugate(world[HAND.parents[1:17]]), world[1:])
    along = positions[ENDS] - positions[BONES]
    if side == "left":
        local, along = mirror_quats(local), along * [-1, 1, 1]
    live = messages()["live"]
    _, joints = pose_in_world(HAND, [side], angles[None], live.hands[side].wrist[None], 1.0)
    hand = replace(live.hands[side], rotations=local, joints=joints[0])
    return replace(live, hands={side: hand}), along / np.linalg.norm(along, axis=1, keepdims=True)
