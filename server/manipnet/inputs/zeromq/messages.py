"""Reads the body messages that one ZeroMQ socket receives, which `docs/protocol-in.md` describes."""

import math
import time
from typing import Any, Final

import zmq

from manipnet.inputs.base import Intake
from manipnet.inputs.sender_clock import PLAUSIBLE, SenderClock
from manipnet.net.rate_limit import SourceRateLimiter
from manipnet.wire.bodies import MAX_MESSAGE_BYTES, MessageError, parse_bodies

MOST_CLOCKS: Final = 64
CLOCK_SPEEDS: Final = (PLAUSIBLE[0] / 5.0, math.inf)
"""A sender may play as slowly or as fast as it likes; a wrong unit shows in jumps from frame to frame."""


class BodyMessages:
    """Turns the parts of messages into frames for an intake. Belongs to the thread of its socket."""

    def __init__(self, intake: Intake) -> None:
        self._intake = intake
        self._rate_limiter = SourceRateLimiter()
        self._clocks: dict[str, SenderClock] = {}
        self._skipping = False

    def status(self) -> dict[str, Any]:
        """By source, the clock in use and why others were set aside. From any thread."""
        return {source: {"clock": clock.report()} for source, clock in list(self._clocks.items())}

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
        t_s = self._time(source, frame.t_s, now_s)
        self._intake.accept(frame if t_s == frame.t_s else frame._replace(t_s=t_s))

    def _time(self, source: str, t_s: float, now_s: float) -> float:
        """The time of a frame: its `t`, or its arrival if the sender's `t` is no running clock."""
        clock = self._clocks.get(source)
        if clock is None:
            if len(self._clocks) >= MOST_CLOCKS:
                del self._clocks[next(iter(self._clocks))]
            clock = self._clocks[source] = SenderClock(("t",), CLOCK_SPEEDS)
        clock.clocks[0].note(t_s, now_s)
        chosen_s = clock.choose((t_s,), now_s, repeats=False)
        return t_s if chosen_s is None else chosen_s


def source_of(part: zmq.Frame) -> str:
    """The peer's address and the descriptor of its connection, which tells two senders on one machine apart."""
    return f"zmq:{part.get('Peer-Address')}#{part.get(zmq.SRCFD)}"
