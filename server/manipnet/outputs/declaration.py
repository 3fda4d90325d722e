"""How a protocol that sends hands declares itself; `manipnet.outputs.OUTPUTS` lists the declarations.

The command line, the rig file, the counters, the `ready` line and the documentation read them. A module with a
declaration loads at `--help`, so it imports heavy libraries only inside `open`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from manipnet.common.options import Protocol

if TYPE_CHECKING:
    from manipnet.net.curve_keys import ServerKeys
    from manipnet.synthesis.hand.hand import Hand
    from manipnet.synthesis.hand.profile import HandProfile
    from manipnet.telemetry import Telemetry
    from manipnet.wire import HandsMessage


Submit = Callable[[bytes, Callable[[bytes], object]], object]
"""Passes on a request in JSON or msgpack, and returns at once; the second argument gets the answer, on any thread."""


def no_requests(_request: bytes, reply: Callable[[bytes], object]) -> None:
    """Refuse every request."""
    reply(b'{"error": "this server takes no requests here"}')


@dataclass(frozen=True, slots=True)
class Emission:
    """What every output needs of the server."""

    telemetry: "Telemetry"
    hand: "Hand"
    """The hand that the messages describe."""
    host: str = "127.0.0.1"
    """The address of this machine to listen on."""
    keys: "ServerKeys | None" = None
    """The keys that clients must have where a protocol knows keys."""
    avatars: Mapping[str, str] = field(default_factory=dict)
    """The name of the avatar that was given for an actor at the start, by the actor's name."""
    submit: Submit = no_requests
    """Takes the requests of clients that receive hands. Only `hand_profile` is allowed."""


class EncodedHands:
    """A hands message and its two encodings, each of which is made once, when the first client needs it."""

    def __init__(self, message: "HandsMessage") -> None:
        """Raises `MessageError` for a message that breaks the protocol's rules, before anybody gets it."""
        from manipnet.wire import check

        self._numbers = check(message)
        self.message = message

    @cached_property
    def binary(self) -> bytes:
        """The payload of `pose/bin`."""
        from manipnet.wire import encode_binary

        return encode_binary(self.message, self._numbers)

    @cached_property
    def msgpack(self) -> bytes:
        """The payload of `pose/msgpack`."""
        from manipnet.wire import encode_msgpack

        return encode_msgpack(self.message, self._numbers)


class HandsOutput:
    """Sends hands by one protocol, from its creation until `close`. Belongs to the tick thread."""

    address: str | None = None
    """Where it listens for clients, or None for an output that sends to a configured address."""

    def send(self, hands: EncodedHands) -> bool:
        """Send one message and return at once; False if it went to nobody. Raises `OSError` if it cannot be sent."""
        raise NotImplementedError

    def wants(self, avatar: str) -> bool:
        """Whether a client has subscribed to the hands of an avatar, by the name of its profile."""
        return False

    def send_avatar(self, hands: EncodedHands, profile: "HandProfile") -> bool:
        """Send the hands of an avatar, whose profile is given, in the encodings that clients want.

        Returns whether they were sent in place of the model's hands, which `send` has left out.
        Raises `OSError` if they cannot be sent, and `MessageError` for a message that breaks the protocol's rules.
        """
        return False

    def close(self) -> None:
        """Close the sockets. Does nothing the second time."""
        raise NotImplementedError

    def connected(self) -> int | None:
        """The number of clients that are connected, or None for a protocol without connections. From any thread."""
        return None


@dataclass(frozen=True)
class Output(Protocol):
    """A protocol that sends hands."""

    open: Callable[[Any, Emission], HandsOutput]
    """Begin to listen or to send, from an instance of `options`. Raises `ListenError` and `ConfigError`."""
    topics: tuple[str, ...] = ()
    """The labels of the counter `messages_out` for each message, if that is not `name`."""

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels of the counter `messages_out`."""
        return self.topics or (self.name,)
