"""From the hands of a tick to a published message, with the latency in it and in the statistics."""

import time
from collections.abc import Callable, Mapping

from manipnet.actors.actor import Actor
from manipnet.actors.hands_message import hands_message
from manipnet.actors.transitions import ShownHand
from manipnet.runtime.tick_errors import TickErrors
from manipnet.telemetry import Telemetry
from manipnet.tracking.tick import Tick
from manipnet.wire import STATES, HandsMessage, Latency, Side


class TickPublisher:
    """Publishes the hands of every tick. Belongs to the tick thread."""

    def __init__(
        self, session: str, publish: Callable[[HandsMessage], object], errors: TickErrors, telemetry: Telemetry
    ) -> None:
        self._session, self._publish, self._errors, self._telemetry = session, publish, errors, telemetry
        self._count_hand = {state: telemetry.counter("hand_ticks", state=state) for state in STATES}
        self._published_s: dict[str, float] = {}

    def send(self, actor: Actor, tick: Tick, hands: Mapping[Side, ShownHand]) -> HandsMessage | None:
        """Publish the hands of an actor; returns the message, or None if it could not be made."""
        for hand in hands.values():
            self._count_hand[hand.state]()
        now_s = time.monotonic()
        message = None
        try:
            message = hands_message(self._session, actor, tick, hands, now_s, self._latency(tick, now_s))
            self._publish(message)
        except Exception as error:
            self._errors.report("publish", error, tick)
        self._record(actor.config.name, tick, now_s)
        return message

    def _latency(self, tick: Tick, now_s: float) -> Latency:
        spent_s = now_s - tick.waited_for_s
        return Latency(
            buffer=1e3 * tick.look_ahead_s,
            total=1e3 * (tick.look_ahead_s + spent_s),
            **self._telemetry.stages.last_ms,
        )

    def _record(self, actor: str, tick: Tick, started_s: float) -> None:
        now_s = time.monotonic()
        timings = self._telemetry.timings
        timings.record("encode", now_s - started_s)
        timings.record("total", now_s - tick.waited_for_s)
        if actor in self._published_s:
            timings.record("interval", now_s - self._published_s[actor])
        self._published_s[actor] = now_s
