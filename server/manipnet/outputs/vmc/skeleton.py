"""The poses of a VMC receiver's bones for the pose of the model's hand.

Rotations are local and relative to the receiver's T-pose (arms out, palms down, fingers straight), left-handed, Y up,
as in Unity. The arms are not tracked, so the hand's rotation is right below an arm in T-pose; where another program
moves the arms, only the fingers fit. Source: VMC protocol specification, marionette side.
"""

import numpy as np

from manipnet.geometry import Array, Side, matrix_to_quat, mirror_quats, quat_conjugate, quat_multiply, quat_rotate
from manipnet.outputs.axes import to_unity
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.wire import HandPose
from manipnet.wire.hand_names import BONE_NAMES

FOREARM_M = 0.25
"""Distance from the elbow to the hand, for receivers that apply positions too. The elbow is not tracked."""

_PARTS = ("Proximal", "Intermediate", "Distal")
FINGER_BONES = {f"Thumb{part}": 2 + i for i, part in enumerate(_PARTS)} | {
    f"{finger}{part}": 5 + 3 * i + j
    for i, finger in enumerate(("Index", "Middle", "Ring", "Little"))
    for j, part in enumerate(_PARTS)
}
"""VMC's finger bones, without "Left" or "Right", and the index of the bone that each one follows.

Unity's ThumbProximal has both carpal angles of the thumb, so the names of the thumb's bones are one joint lower.
"""

_BONES = np.array(list(FINGER_BONES.values()))
_LEVELS = ([1, 5, 8, 11, 14], [2, 6, 9, 12, 15], [3, 7, 10, 13, 16], [4])
_BONE_COUNT = len(BONE_NAMES)

_WRIST_TO_T_POSE = matrix_to_quat(np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]))
"""A right wrist in T-pose, for a person who faces +z: fingers to -x, thumb to +z, back of the hand up."""

_T_POSE_DIRECTIONS = np.tile([1.0, 0.0, 0.0], (_BONE_COUNT, 1))
_T_POSE_DIRECTIONS[1:5] = [np.sqrt(0.5), np.sqrt(0.5), 0.0]
"""The direction of each bone in the receiver's T-pose, in the wrist frame: fingers straight, thumb at 45 degrees."""


def bone_names(side: Side) -> list[str]:
    """VMC's names of the hand and its 15 finger bones."""
    return [side.capitalize() + bone for bone in ("Hand", *FINGER_BONES)]


class VmcSkeleton:
    """Computes the poses of the receiver's bones.

    With `rest_pose_correction`, each bone is turned by the difference between its directions at angle zero and in the
    T-pose, so that it points where the hand's bone does. Without it, angle zero appears as the T-pose.
    """

    def __init__(self, hand: Hand, rest_pose_correction: bool = True) -> None:
        self._zero_positions, matrices = forward_kinematics(hand, np.zeros(hand.angle_count))
        self._zero = matrix_to_quat(matrices)
        self._parents = hand.parents[:_BONE_COUNT]
        above = self._parents[_BONES]
        self._bone_parents = np.where(above == 1, 0, above)
        self._offsets = self._t_pose_offsets()
        self._correction = np.tile([0.0, 0.0, 0.0, 1.0], (_BONE_COUNT, 1))
        if rest_pose_correction:
            self._correction[_BONES] = self._rest_pose_correction(hand)

    def bone_poses(self, side: Side, pose: HandPose) -> Array:
        """Local poses `(16, 7)` of the receiver's bones in Unity's axes, in the order of `bone_names`."""
        turns = self._turns_from_t_pose(pose.rotations if side == "right" else mirror_quats(pose.rotations))
        fingers = quat_multiply(quat_conjugate(turns[self._bone_parents]), turns[_BONES])
        wrist = np.concatenate([[-FOREARM_M, 0.0, 0.0], _hand_turn(side, pose)])
        poses = np.vstack([wrist, np.hstack([self._offsets, fingers])])
        # These are poses of a right hand. A left hand is its mirror image, and Unity's axes mirror it once more.
        return to_unity(poses) if side == "right" else poses

    def _turns_from_t_pose(self, local: Array) -> Array:
        """The rotation of each bone of a right hand from the T-pose, `(17, 4)`, in the project frame of the T-pose."""
        world = np.empty((_BONE_COUNT, 4))
        world[0] = [0.0, 0.0, 0.0, 1.0]
        for bones in _LEVELS:
            world[bones] = quat_multiply(world[self._parents[bones]], local[bones])
        turns = quat_multiply(quat_multiply(world, quat_conjugate(self._zero)), self._correction)
        return quat_multiply(quat_multiply(_WRIST_TO_T_POSE, turns), quat_conjugate(_WRIST_TO_T_POSE))

    def _rest_pose_correction(self, hand: Hand) -> Array:
        """The shortest rotation of each finger bone from its direction in T-pose to that at angle zero, `(15, 4)`."""
        children = [hand.parents.tolist().index(bone) for bone in _BONES]
        along = self._zero_positions[children] - self._zero_positions[_BONES]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        return np.stack([shortest_turn(*ends) for ends in zip(_T_POSE_DIRECTIONS[_BONES], along, strict=True)])

    def _t_pose_offsets(self) -> Array:
        """The start of each bone in its parent `(15, 3)`: knuckles where the hand has them, then straight fingers."""
        parents = self._bone_parents
        offsets = self._zero_positions[_BONES] - self._zero_positions[parents]
        lengths = np.linalg.norm(offsets, axis=1, keepdims=True)
        straight = np.where(parents[:, None] == 0, offsets, lengths * _T_POSE_DIRECTIONS[parents])
        return quat_rotate(_WRIST_TO_T_POSE, straight)


def _hand_turn(side: Side, hand: HandPose) -> Array:
    """The rotation of the wrist from the T-pose, as that of a right hand."""
    q = hand.wrist[3:] if side == "right" else mirror_quats(hand.wrist[3:])
    return quat_multiply(q, quat_conjugate(_WRIST_TO_T_POSE))


def shortest_turn(start: Array, end: Array) -> Array:
    """The rotation about the shortest way from one direction to another; half a turn from one to its opposite."""
    q = np.concatenate([np.cross(start, end), [1.0 + start @ end]])
    if np.linalg.norm(q) < 1e-6:
        q = np.append(np.cross(start, np.eye(3)[np.argmin(np.abs(start))]), 0.0)
    return q / np.linalg.norm(q)
