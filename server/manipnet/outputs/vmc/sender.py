"""Sends hands as VMC (Virtual Motion Capture) bones, over OSC and UDP.

Each hand is a bundle of at most 1472 bytes, which fits into a 1500-byte packet with its IP and UDP headers.
Source: VMC protocol specification, marionette side.
"""

import socket
from collections.abc import Mapping

from manipnet.outputs.declaration import EncodedHands, HandsOutput
from manipnet.outputs.vmc.avatar import AvatarSkeleton
from manipnet.outputs.vmc.bundle import HandBundle
from manipnet.outputs.vmc.skeleton import VmcSkeleton, bone_names
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.wire import SIDES, HandsMessage


class VmcSender(HandsOutput):
    """Sends the hands of one actor to one receiver, which shows one avatar."""

    def __init__(
        self,
        host: str,
        port: int,
        hand: Hand,
        fingers_only: bool = False,
        actor: str | None = None,
        avatars: Mapping[str, str] | None = None,
    ) -> None:
        """`hand` is the model's hand. Without an `actor`, the first one that has a message is sent.

        `avatars` has the name of the avatar of an actor, which is sent in place of the model's hand. With
        `fingers_only`, the receiver gets no hand bone: its hand follows another program, and the fingers, whose
        rotations are relative to the hand, still fit.
        """
        self._address = (host, port)
        self._skeleton = VmcSkeleton(hand)
        self._first_bone = 1 if fingers_only else 0
        self._actor, self._avatars = actor, dict(avatars or {})
        self._avatar: AvatarSkeleton | None = None
        self._bundles = {side: HandBundle(bone_names(side)[self._first_bone :]) for side in SIDES}
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._start_s: float | None = None

    def send(self, hands: EncodedHands) -> bool:
        """Send one datagram for each hand of the actor, unless an avatar's hands are sent in place of them.

        Raises `OSError` if the address cannot be reached.
        """
        message = hands.message
        self._actor = self._actor or message.actor
        if message.actor != self._actor or self._actor in self._avatars:
            return False
        self._send(message, self._skeleton)
        return True

    def wants(self, avatar: str) -> bool:
        """Whether an avatar's hands are sent, by the name of its profile."""
        return self._actor in self._avatars and self._avatars[self._actor] == avatar

    def send_avatar(self, hands: EncodedHands, profile: HandProfile) -> bool:
        """Send one datagram for each hand of the actor's avatar. Raises `OSError` if the address cannot be reached."""
        message = hands.message
        if message.actor != self._actor or not self.wants(profile.name):
            return False
        if self._avatar is None or self._avatar.profile is not profile:
            self._avatar = skeleton = AvatarSkeleton(profile)
            self._bundles = {side: HandBundle(skeleton.bone_names(side)[self._first_bone :]) for side in SIDES}
        self._send(message, self._avatar)
        return True

    def _send(self, message: HandsMessage, skeleton: VmcSkeleton | AvatarSkeleton) -> None:
        if self._start_s is None:
            self._start_s = message.t_publish
        for side, hand in message.hands.items():
            poses = skeleton.bone_poses(side, hand)[self._first_bone :]
            self._socket.sendto(self._bundles[side].filled(message.t_publish - self._start_s, poses), self._address)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
