"""The loop that turns frames into hands: it takes what the receivers left, steps every hand that is due in one batch,
and publishes.

It is the only thread that touches the actors, and it never waits for a client, a disk or a terminal.
"""

import logging
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Final, Protocol

from manipnet.actors.actor import Actor
from manipnet.actors.plan import Plan, synthesise
from manipnet.actors.transitions import ShownHand
from manipnet.runtime.avatars import Avatars
from manipnet.runtime.flight_recorder import FlightRecorder
from manipnet.runtime.frame_intake import FrameIntake
from manipnet.runtime.mailbox import Mailbox
from manipnet.runtime.tick_errors import TickErrors
from manipnet.runtime.tick_publisher import TickPublisher
from manipnet.synthesis.synthesizer import Synthesizer
from manipnet.telemetry import Telemetry
from manipnet.tracking.tick import Tick
from manipnet.wire import HandsMessage, Side

MAX_WAIT_S: Final = 0.05
"""The loop notices within this time that it must stop."""
_log = logging.getLogger(__name__)


class TickObserver(Protocol):
    """Sees the inputs and results of every tick while it is `watched`; `see` must return at once."""

    @property
    def watched(self) -> bool: ...

    def see(self, actor: Actor, plan: Plan, message: HandsMessage) -> None: ...


class TickLoop:
    """Steps and publishes the hands of several actors."""

    def __init__(
        self,
        session: str,
        actors: Sequence[Actor],
        synthesizer: Synthesizer,
        publish: Callable[[HandsMessage], object],
        mailbox: Mailbox,
        recorder: FlightRecorder,
        telemetry: Telemetry,
        observer: TickObserver | None = None,
        avatars: Avatars | None = None,
    ) -> None:
        self._actors, self._synthesizer, self._mailbox = actors, synthesizer, mailbox
        self._telemetry, self._observer, self._avatars = telemetry, observer, avatars
        self._errors = TickErrors(actors, recorder, telemetry)
        self._intake = FrameIntake(actors, recorder, self._errors, telemetry)
        self._publisher = TickPublisher(session, publish, self._errors, telemetry)

    def run(self, stopping: Callable[[], bool], every_second: Callable[[float], None]) -> None:
        """Run until `stopping`; `every_second` is called with the time, at absolute deadlines one second apart."""
        next_second_s = time.monotonic() + 1.0
        while not stopping():
            now_s = time.monotonic()
            next_tick_s = min(actor.next_poll_s(now_s) for actor in self._actors)
            self.take_in(min(next_tick_s, next_second_s, now_s + MAX_WAIT_S) - now_s)
            self.step(time.monotonic())
            now_s = time.monotonic()
            if now_s >= next_second_s:
                next_second_s = second_after(now_s, next_second_s)
                if self._avatars is not None:
                    self._avatars.forget_unwanted()
                try:
                    every_second(now_s)
                except Exception:
                    _log.exception("the state of this second cannot be reported")

    def take_in(self, wait_s: float) -> None:
        """Give every actor what the receivers left, after a wait of at most `wait_s` for what lets a tick fall due."""
        for frame in self._mailbox.wait(wait_s, self._awaited()):
            try:
                self._intake.push(frame)
            except Exception as error:
                self._errors.report("input", error)

    def step(self, now_s: float) -> bool:
        """Show the next tick of every actor that has one due; returns whether any had."""
        plans = [(actor, self._plan(actor, tick)) for actor in self._actors if (tick := actor.poll(now_s)) is not None]
        self._synthesise([plan for _, plan in plans])
        for actor, plan in plans:
            hands = self._show(actor, plan)
            message = self._publisher.send(actor, plan.tick, hands)
            if message is not None and self._avatars is not None:
                self._avatars.show(actor, plan.tick, hands, message)
            if message is not None and self._observer is not None and self._observer.watched:
                try:
                    self._observer.see(actor, plan, message)
                except Exception:
                    _log.exception("a tick cannot be shown on the page")
        return bool(plans)

    def _awaited(self) -> dict[str, float]:
        """By sender, the earliest time of a frame that lets a tick fall due; empty if any frame may."""
        earliest_s: dict[str, float] = {}
        for actor in self._actors:
            awaited = actor.awaited()
            if awaited is None:
                return {}
            source, t_s = awaited
            earliest_s[source] = min(earliest_s.get(source, t_s), t_s)
        return earliest_s

    def _plan(self, actor: Actor, tick: Tick) -> Plan:
        try:
            return actor.plan(tick)
        except Exception as error:
            self._errors.report("plan", error, tick)
            return Plan(tick)

    def _synthesise(self, plans: Sequence[Plan]) -> None:
        self._telemetry.stages.begin()
        try:
            synthesise(plans, self._synthesizer)
        except Exception as error:
            self._errors.report("synthesis", error, *(plan.tick for plan in plans))

    def _show(self, actor: Actor, plan: Plan) -> Mapping[Side, ShownHand]:
        """What the actor shows; after an error, what it showed last."""
        if plan.states:
            try:
                return actor.show(plan)
            except Exception as error:
                self._errors.report("show", error, plan.tick)
        return actor.hold(plan.tick)


def second_after(now_s: float, deadline_s: float) -> float:
    """The next of the deadlines one second apart that is half a second away or more, also after a long tick.

    What is counted over less time says little as a rate.
    """
    return deadline_s + 1.0 + math.floor(now_s - deadline_s + 0.5)
