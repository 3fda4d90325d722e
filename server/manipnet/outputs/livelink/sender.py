"""Sends hands in Epic's JSON Live Link format, for its sample receiver, which listens on UDP port 54321.

There is one datagram for each hand: `{"<subject>": [{"Name", "Parent", "Location", "Rotation", "Scale"}, …]}`. The
bones are the OpenXR joints below the wrist, relative to their parents, in Unreal's axes and centimetres.
"""

import json
import socket

import numpy as np

from manipnet.geometry import Array, compose, invert
from manipnet.outputs.axes import to_unreal
from manipnet.outputs.declaration import EncodedHands, HandsOutput
from manipnet.wire import Side
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES, OPENXR_PARENTS

ORDER = (1, 0, *range(2, 26))
"""The wrist comes first, since Live Link expects parents before children."""


class LiveLinkJsonSender(HandsOutput):
    """Sends the hands of each message to one receiver, as the subjects "ManipNet_<actor>_<side>"."""

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, hands: EncodedHands) -> bool:
        """Send one datagram for each hand. Raises `OSError` if the address cannot be reached."""
        message = hands.message
        for side, hand in message.hands.items():
            self._socket.sendto(hand_json(message.actor, side, hand.joints), self._address)
        return True

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def hand_json(actor: str, side: Side, joints: Array) -> bytes:
    """The datagram of one hand, from the world poses of its `joints (26, 7)`."""
    local = joints.copy()
    children = list(ORDER[1:])
    parents = [OPENXR_PARENTS[joint] for joint in children]
    local[children] = compose(invert(joints[parents]), joints[children])
    poses = np.round(to_unreal(local), 6)
    bones = [
        {
            "Name": OPENXR_JOINT_NAMES[joint],
            "Parent": ORDER.index(OPENXR_PARENTS[joint]) if joint in children else -1,
            "Location": poses[joint, :3].tolist(),
            "Rotation": poses[joint, 3:].tolist(),
            "Scale": [1.0, 1.0, 1.0],
        }
        for joint in ORDER
    ]
    return json.dumps({f"ManipNet_{actor}_{side}": bones}, separators=(",", ":")).encode()
