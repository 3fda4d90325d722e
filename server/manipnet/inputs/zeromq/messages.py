"""Reads the body messages that one ZeroMQ socket receives, which `docs/protocol-in.md` describes."""

import time
from typing import Any, Final

import zmq

from manipnet.inputs.base import Intake
from manipnet.inputs.zeromq.sender import ZmqSender
from manipnet.net.rate_limit import SourceRateLimiter
from manipnet.wire.bodies import MAX_MESSAGE_BYTES, MessageError, parse_bodies

MOST_SENDERS: Final = 64
_WAITED = "it has waited for the server, and states no time of its capture"


class BodyMessages:
    """Turns the parts of messages into frames for an intake. Belongs to the thread of its socket."""

    def __init__(self, intake: Intake) -> None:
        self._intake = intake
        self._rate_limiter = SourceRateLimiter()
        self._senders: dict[str, ZmqSender] = {}
        self._skipping = False

    def status(self) -> dict[str, Any]:
        """By source, the clock in use and why others were set aside. From any thread."""
        return {source: {"clock": sender.clock.report()} for source, sender in list(self._senders.items())}

    def take(self, part: zmq.Frame) -> None:
        """Take one part. A message of several parts is refused when its last part has come."""
        skipping, self._skipping = self._skipping, part.more
        if part.more:
            return
        if skipping:
            text = "the message has several frames; send one, without a topic in front"
            self._intake.drop("malformed", source_of(part), text)
        else:
            self.receive(part.bytes, source_of(part), time.monotonic())

    def receive(self, message: bytes, source: str, now_s: float) -> None:
        """Take one message."""
        if not self._rate_limiter.admits(source, now_s):
            self._intake.drop("rate", source, "too many messages that cannot be used")
            return
        try:
            frame = parse_bodies(message, now_s, source)
        except MessageError as error:
            self._rate_limiter.bad(source)
            self._intake.drop("oversized" if len(message) > MAX_MESSAGE_BYTES else "malformed", source, error)
            return
        self._rate_limiter.good(source)
        t_s = self._sender(source).time(frame)
        if t_s is None:
            self._intake.drop("backlog", source, _WAITED)
        else:
            self._intake.accept(frame if t_s == frame.t_s else frame._replace(t_s=t_s))

    def _sender(self, source: str) -> ZmqSender:
        sender = self._senders.get(source)
        if sender is None:
            if len(self._senders) >= MOST_SENDERS:
                del self._senders[next(iter(self._senders))]
            sender = self._senders[source] = ZmqSender()
        return sender


def source_of(part: zmq.Frame) -> str:
    """The peer's address and the descriptor of its connection, which tells two senders on one machine apart."""
    return f"zmq:{part.get('Peer-Address')}#{part.get(zmq.SRCFD)}"
