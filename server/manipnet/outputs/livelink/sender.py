"""Sends hands and props in Epic's JSON Live Link format, for its sample receiver, which listens on UDP port 54321.

There is one datagram for each subject: `{"<subject>": [{"Name", "Parent", "Location", "Rotation", "Scale"}, …]}`. The
bones of a hand are the OpenXR joints below the wrist, relative to their parents, in Unreal's axes and centimetres. The
format knows only skeletons, so a prop is one with a single bone, and it has no room for a timecode. The receiver keeps
the bones that it first sees, so a subject always has the same ones.
"""

import json
import socket
from collections.abc import Collection, Sequence
from typing import Any, Final

import numpy as np

from manipnet.geometry import Array, compose, invert
from manipnet.outputs.axes import to_unreal
from manipnet.outputs.declaration import EncodedHands, HandsOutput
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.wire import SIDES, HandsMessage
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES, OPENXR_PARENTS

ORDER: Final = (1, 0, *range(2, 26))
"""The wrist comes first, since Live Link expects parents before children."""
PROP_BONE: Final = "prop"
_WRISTS: Final = tuple(f"{side}_wrist" for side in SIDES)


class LiveLinkJsonSender(HandsOutput):
    """Sends each message to one receiver.

    The subjects are "ManipNet_<actor>_<side>", "ManipNet_<actor>_<avatar>_<side>" for the hands of an avatar, and
    "ManipNet_<actor>_prop_<body>" for a prop while it is tracked.
    """

    def __init__(self, host: str, port: int, avatars: Collection[str] = ()) -> None:
        """`avatars` are the names of the avatars whose hands are sent, too."""
        self._address, self._avatars = (host, port), frozenset(avatars)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, hands: EncodedHands) -> bool:
        """Send one datagram for each hand and prop. Raises `OSError` if the address cannot be reached."""
        message = hands.message
        self._send_hands(message, message.actor)
        for body in message.bodies:
            if body.tracked and body.name not in _WRISTS:
                self._send(subject_json(f"{message.actor}_prop_{body.name}", (PROP_BONE,), (-1,), body.pose[None]))
        return True

    def wants(self, avatar: str) -> bool:
        """Whether the hands of an avatar are sent, by the name of its profile."""
        return avatar in self._avatars

    def send_avatar(self, hands: EncodedHands, profile: HandProfile) -> bool:
        """Send one datagram for each hand of an avatar. Raises `OSError` if the address cannot be reached."""
        if self.wants(profile.name):
            self._send_hands(hands.message, f"{hands.message.actor}_{profile.name}")
        return False

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _send_hands(self, message: HandsMessage, owner: str) -> None:
        for side, hand in message.hands.items():
            self._send(hand_json(f"{owner}_{side}", hand.joints))

    def _send(self, datagram: bytes) -> None:
        self._socket.sendto(datagram, self._address)


def hand_json(subject: str, joints: Array) -> bytes:
    """The datagram of one hand, from the world poses of its `joints (26, 7)`."""
    names = [OPENXR_JOINT_NAMES[joint] for joint in ORDER]
    parents = [-1 if joint == ORDER[0] else ORDER.index(OPENXR_PARENTS[joint]) for joint in ORDER]
    return subject_json(subject, names, parents, joints[list(ORDER)])


def subject_json(subject: str, names: Sequence[str], parents: Sequence[int], world: Array) -> bytes:
    """The datagram of a skeleton whose bones have these names, parents (-1 for the root) and world poses `(N, 7)`."""
    local = world.copy()
    children = [bone for bone, parent in enumerate(parents) if parent >= 0]
    local[children] = compose(invert(world[[parents[bone] for bone in children]]), world[children])
    poses = np.round(to_unreal(local), 6).tolist()
    bones: list[dict[str, Any]] = [
        {"Name": name, "Parent": parent, "Location": pose[:3], "Rotation": pose[3:], "Scale": [1.0, 1.0, 1.0]}
        for name, parent, pose in zip(names, parents, poses, strict=True)
    ]
    return json.dumps({f"ManipNet_{subject}": bones}, separators=(",", ":")).encode()
