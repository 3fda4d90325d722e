"""Sends hands as VMC (Virtual Motion Capture) bones, over OSC and UDP.

There is one bundle for each hand, of 1472 bytes, which just fits into a 1500-byte packet with its IP and UDP headers.
Source: VMC protocol specification, marionette side.
"""

import socket

from manipnet.outputs.declaration import EncodedHands, HandsOutput
from manipnet.outputs.vmc.bundle import HandBundle
from manipnet.outputs.vmc.skeleton import VmcSkeleton, bone_names
from manipnet.synthesis.hand.hand import Hand
from manipnet.wire import SIDES


class VmcSender(HandsOutput):
    """Sends the hands of each message to one receiver."""

    def __init__(self, host: str, port: int, hand: Hand) -> None:
        """`hand` is the hand that the messages describe."""
        self._address = (host, port)
        self._skeleton = VmcSkeleton(hand)
        self._bundles = {side: HandBundle(bone_names(side)) for side in SIDES}
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._start_s: float | None = None

    def send(self, hands: EncodedHands) -> bool:
        """Send one datagram for each hand. Raises `OSError` if the address cannot be reached."""
        message = hands.message
        if self._start_s is None:
            self._start_s = message.t_publish
        for side, hand in message.hands.items():
            poses = self._skeleton.bone_poses(side, hand)
            self._socket.sendto(self._bundles[side].filled(message.t_publish - self._start_s, poses), self._address)
        return True

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
