"""Fingers out as VMC (Virtual Motion Capture) bones: for receivers that exist already, over OSC and UDP.

One bundle per hand, 1472 bytes: what a 1500-byte packet holds after its IP and UDP headers. Rotations are local and
relative to the receiver's T-pose (arms out, palms down, fingers straight), left-handed, Y up, as in Unity.
Source: VMC protocol specification, marionette side.
"""

import socket

import numpy as np

from manipnet.geometry import Array, matrix_to_quat, mirror_quats, quat_conjugate, quat_multiply, quat_rotate
from manipnet.outputs.axes import to_unity
from manipnet.outputs.declaration import EncodedHands, HandsOutput
from manipnet.outputs.vmc.bundle import HandBundle
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.skeleton import BONE_COUNT, DOF_COUNT, PARENTS
from manipnet.wire import SIDES, HandPose, Side

FOREARM_M = 0.25
"""Where the hand sits in the forearm, for receivers that apply positions too: nobody tracks the elbow."""

_PARTS = ("Proximal", "Intermediate", "Distal")
FINGER_BONES = {f"Thumb{part}": 2 + i for i, part in enumerate(_PARTS)} | {
    f"{finger}{part}": 5 + 3 * i + j
    for i, finger in enumerate(("Index", "Middle", "Ring", "Little"))
    for j, part in enumerate(_PARTS)
}
"""VMC's finger bones, after "Left" or "Right", and our bone each follows.

The two carpal angles multiply into what Unity calls ThumbProximal, so the thumb's names sit one joint lower.
"""

_BONES = np.array(list(FINGER_BONES.values()))
_LEVELS = ([1, 5, 8, 11, 14], [2, 6, 9, 12, 15], [3, 7, 10, 13, 16], [4])
_BONE_PARENTS = np.where(PARENTS[_BONES] == 1, 0, PARENTS[_BONES])
_ZERO_POSITIONS, _zero_matrices = forward_kinematics(np.zeros(DOF_COUNT))
_ZERO = matrix_to_quat(_zero_matrices)

_WRIST_TO_T_POSE = matrix_to_quat(np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]))
"""A right wrist in T-pose, in the project frame of a person facing +z: fingers to -x, thumb to +z, back of hand up."""

_T_POSE_DIRECTIONS = np.tile([1.0, 0.0, 0.0], (BONE_COUNT, 1))
_T_POSE_DIRECTIONS[1:5] = [np.sqrt(0.5), np.sqrt(0.5), 0.0]
"""Where each bone of the receiver's T-pose points, in the wrist frame: fingers along the hand, thumb at 45 degrees."""


class VmcSender(HandsOutput):
    """Sends every message's hands to one receiver. Not thread-safe.

    `rest_pose_correction` turns each bone by what its direction at angle zero differs from the T-pose's, so that
    bones point where the hand's do; without it angle zero shows as the T-pose.
    """

    def __init__(self, host: str, port: int, rest_pose_correction: bool = True) -> None:
        self._address = (host, port)
        self._correction = _rest_pose_correction() if rest_pose_correction else _IDENTITY_CORRECTION
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._start_s: float | None = None

    def send(self, hands: EncodedHands) -> bool:
        """Send one datagram for each hand. Raises `OSError` if the address cannot be reached."""
        message = hands.message
        if self._start_s is None:
            self._start_s = message.t_publish
        for side, hand in message.hands.items():
            bundle = hand_bundle(side, hand, message.t_publish - self._start_s, self._correction)
            self._socket.sendto(bundle, self._address)
        return True

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def hand_bundle(side: Side, hand: HandPose, t_s: float, correction: Array) -> bytes:
    """The OSC bundle of one hand: OK, T and its 16 bones."""
    return _BUNDLES[side].filled(t_s, np.array(list(bone_poses(side, hand, correction).values())))


def bone_poses(side: Side, hand: HandPose, correction: Array) -> dict[str, Array]:
    """Local poses `(7,)` of the receiver's bones, Unity axes, by VMC name; `correction (17, 4)`."""
    turns = _turns_from_t_pose(hand.rotations if side == "right" else mirror_quats(hand.rotations), correction)
    fingers = quat_multiply(quat_conjugate(turns[_BONE_PARENTS]), turns[_BONES])
    wrist = np.concatenate([[-FOREARM_M, 0.0, 0.0], _hand_turn(side, hand)])
    poses = np.vstack([wrist, np.hstack([_T_POSE_OFFSETS, fingers])])
    # So far it is a right hand. A left one is its mirror image, and Unity's axes mirror once more.
    in_unity = to_unity(poses) if side == "right" else poses
    return dict(zip(_names(side), in_unity, strict=True))


def _names(side: Side) -> list[str]:
    return [side.capitalize() + bone for bone in ("Hand", *FINGER_BONES)]


def _turns_from_t_pose(local: Array, correction: Array) -> Array:
    """How far each bone of a right hand is turned from the T-pose, `(17, 4)`, in the T-pose's project frame."""
    world = np.empty((BONE_COUNT, 4))
    world[0] = [0.0, 0.0, 0.0, 1.0]
    for bones in _LEVELS:
        world[bones] = quat_multiply(world[PARENTS[bones]], local[bones])
    turns = quat_multiply(quat_multiply(world, quat_conjugate(_ZERO)), correction)
    return quat_multiply(quat_multiply(_WRIST_TO_T_POSE, turns), quat_conjugate(_WRIST_TO_T_POSE))


def _hand_turn(side: Side, hand: HandPose) -> Array:
    """The wrist's turn from the T-pose, as of a right hand."""
    q = hand.wrist[3:] if side == "right" else mirror_quats(hand.wrist[3:])
    return quat_multiply(q, quat_conjugate(_WRIST_TO_T_POSE))


def _rest_pose_correction() -> Array:
    """For each bone the shortest turn from its T-pose direction to its direction at angle zero, `(17, 4)`."""
    correction = _IDENTITY_CORRECTION.copy()
    for bone in _BONES:
        child = list(PARENTS).index(bone)
        along = _ZERO_POSITIONS[child] - _ZERO_POSITIONS[bone]
        correction[bone] = _shortest_turn(_T_POSE_DIRECTIONS[bone], along / np.linalg.norm(along))
    return correction


def _shortest_turn(start: Array, end: Array) -> Array:
    q = np.concatenate([np.cross(start, end), [1.0 + start @ end]])
    return q / np.linalg.norm(q)


def _t_pose_offsets() -> Array:
    """Where each bone starts in its parent `(15, 3)`: knuckles where they are, then straight along the finger."""
    offsets = _ZERO_POSITIONS[_BONES] - _ZERO_POSITIONS[_BONE_PARENTS]
    lengths = np.linalg.norm(offsets, axis=1, keepdims=True)
    straight = np.where(_BONE_PARENTS[:, None] == 0, offsets, lengths * _T_POSE_DIRECTIONS[_BONE_PARENTS])
    return quat_rotate(_WRIST_TO_T_POSE, straight)


_IDENTITY_CORRECTION = np.tile([0.0, 0.0, 0.0, 1.0], (BONE_COUNT, 1))
_T_POSE_OFFSETS = _t_pose_offsets()
_BUNDLES = {side: HandBundle(_names(side)) for side in SIDES}
