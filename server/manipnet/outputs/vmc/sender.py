"""Sends hands as VMC (Virtual Motion Capture) bones, over OSC and UDP.

Each hand is a bundle of at most 1472 bytes, which fits into a 1500-byte packet with its IP and UDP headers.
Source: VMC protocol specification, marionette side.
"""

import socket

from manipnet.outputs.declaration import EncodedHands, HandsOutput
from manipnet.outputs.vmc.bundle import HandBundle
from manipnet.outputs.vmc.skeleton import VmcSkeleton, bone_names
from manipnet.synthesis.hand.hand import Hand
from manipnet.wire import SIDES


class VmcSender(HandsOutput):
    """Sends the hands of one actor to one receiver, which shows one avatar."""

    def __init__(self, host: str, port: int, hand: Hand, fingers_only: bool = False, actor: str | None = None) -> None:
        """`hand` is the hand that the messages describe. Without an `actor`, the first one that has a message is sent.

        With `fingers_only`, the receiver gets no hand bone: its hand follows another program, and the fingers, whose
        rotations are relative to the hand, still fit.
        """
        self._address = (host, port)
        self._skeleton = VmcSkeleton(hand)
        self._first_bone = 1 if fingers_only else 0
        self._actor = actor
        self._bundles = {side: HandBundle(bone_names(side)[self._first_bone :]) for side in SIDES}
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._start_s: float | None = None

    def send(self, hands: EncodedHands) -> bool:
        """Send one datagram for each hand of the actor. Raises `OSError` if the address cannot be reached."""
        message = hands.message
        self._actor = self._actor or message.actor
        if message.actor != self._actor:
            return False
        if self._start_s is None:
            self._start_s = message.t_publish
        for side, hand in message.hands.items():
            poses = self._skeleton.bone_poses(side, hand)[self._first_bone :]
            self._socket.sendto(self._bundles[side].filled(message.t_publish - self._start_s, poses), self._address)
        return True

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
