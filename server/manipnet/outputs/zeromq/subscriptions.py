"""Which topics clients have subscribed to, as far as an XPUB socket tells."""

from typing import Final

from manipnet.wire import TOPIC_BIN, TOPIC_MSGPACK

MAX_SUBSCRIPTIONS: Final = 4096
"""Prefixes of topics that are remembered; further subscriptions to avatars are not noticed."""
FORGET_AFTER_S: Final = 10.0
"""How long nobody must be connected before the subscriptions are forgotten: another thread counts connections."""


class Subscriptions:
    """The prefixes of topics that clients have subscribed to since somebody was connected.

    The end of a subscription is only believed when the socket itself reports it, because the last subscriber has
    disconnected. It also passes on what clients send, even from one that never subscribed, so that one packet of a
    stranger would take the hands from everybody else.
    """

    def __init__(self) -> None:
        self._prefixes: set[bytes] = set()
        self._in_use_s = 0.0
        """When somebody was last seen connected, or subscribed."""

    def note(self, message: bytes, is_from_client: bool, now_s: float) -> None:
        """Take in a message of the socket, which a client has sent or which reports that one has disconnected."""
        if message[:1] == b"\x00" and not is_from_client:
            self._prefixes.discard(message[1:])
        elif message[:1] == b"\x01":
            self._in_use_s = now_s
            if len(self._prefixes) < MAX_SUBSCRIPTIONS:
                self._prefixes.add(message[1:])

    def count(self, connected: int, now_s: float) -> None:
        """Take in how many clients are connected, and forget everything when nobody has been for some time."""
        if connected:
            self._in_use_s = now_s
        elif now_s > self._in_use_s + FORGET_AFTER_S:
            self._prefixes.clear()

    def clear(self) -> None:
        """Forget everything, because the socket was closed."""
        self._prefixes.clear()

    def include(self, topic: bytes) -> bool:
        """Whether somebody may have subscribed to the topic, or to a prefix of it."""
        if len(self._prefixes) >= MAX_SUBSCRIPTIONS and topic in (TOPIC_MSGPACK, TOPIC_BIN):
            return True  # the subscription may be one of those that were not remembered
        return any(topic.startswith(prefix) for prefix in self._prefixes)
