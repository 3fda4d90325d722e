"""The loop that turns frames into hands: takes what the receivers left, steps every hand that is due as one batch,
publishes. It is the only thread that touches the actors, and it never waits for a client, a disk or a terminal."""

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from manipnet.actors.actor import Actor, Plan, ShownHand
from manipnet.actors.hands_message import hands_message
from manipnet.runtime.flight_recorder import FlightRecorder
from manipnet.runtime.mailbox import Mailbox
from manipnet.synthesis.synthesizer import HandStep, Side, Synthesizer
from manipnet.telemetry import Telemetry
from manipnet.tracking.outlier_gate import OutlierGate
from manipnet.tracking.timeline import Tick
from manipnet.wire import HandsMessage, Latency
from manipnet.wire.bodies import BodyFrame

MAX_WAIT_S = 0.05
"""A stop is noticed within this."""
_log = logging.getLogger(__name__)

_TAKEN = ""
_BEST_FIRST = (_TAKEN, "duplicate", "other_sender", "late", "time_jump", "internal", "unknown_body")
"""What became of a frame that several actors looked at: the best of what each made of it."""


class TickObserver(Protocol):
    """Whoever wants to see more of a tick than its message, while `watched`; `see` must return at once."""

    @property
    def watched(self) -> bool: ...

    def see(
        self, actor: Actor, tick: Tick, plan: Plan | None, steps: Mapping[Side, HandStep], message: HandsMessage
    ) -> None: ...


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
    ) -> None:
        self.actors = actors
        self._observer = observer
        self._session, self._publish, self._mailbox = session, publish, mailbox
        self._recorder, self._telemetry, self._synthesizer = recorder, telemetry, synthesizer
        self._gate = OutlierGate()
        self._published_s: dict[str, float] = {}

    def run(self, stopping: Callable[[], bool], every_second: Callable[[float], None]) -> None:
        """Until `stopping`. `every_second` is called with the time at absolute deadlines one second apart."""
        next_second_s = time.monotonic() + 1.0
        while not stopping():
            now_s = time.monotonic()
            deadline_s = min(actor.timeline.next_poll_s(now_s) for actor in self.actors)
            self.take_in(min(deadline_s, next_second_s, now_s + MAX_WAIT_S) - now_s)
            while self.step(time.monotonic()):
                self.take_in(0.0)
            if time.monotonic() >= next_second_s:
                every_second(time.monotonic())
                next_second_s += 1.0

    def take_in(self, wait_s: float) -> None:
        """Give every actor what the receivers left, waiting at most `wait_s` for something."""
        for frame in self._mailbox.wait(wait_s):
            self._recorder.note(frame)
            frame, faults = self._gate.check(frame)
            for fault in faults:
                self._telemetry.count("bodies_rejected", reason=fault)
            reasons = [self._push(actor, frame) for actor in self.actors]
            reason = min(reasons, key=_BEST_FIRST.index)
            if reason != _TAKEN:
                self._telemetry.count("frames_dropped", reason=reason)
            if reason == "unknown_body":
                _log.warning("a frame of %s has no body of the rig: %s", frame.source, self._compare(frame))

    def step(self, now_s: float) -> bool:
        """Show the next tick of every actor that has one due; False when none has."""
        ticks = [(actor, self._poll(actor, now_s)) for actor in self.actors]
        plans = [(actor, tick, self._plan(actor, tick)) for actor, tick in ticks if tick is not None]
        steps = self._synthesise([plan for _, _, plan in plans if plan is not None])
        for actor, tick, plan in plans:
            own = {} if plan is None else dict(zip(plan.scenes, steps, strict=False))
            del steps[: len(own)]
            message = self._publish_hands(actor, tick, self._hands(actor, tick, plan, own))
            if message is not None and self._observer is not None and self._observer.watched:
                self._observer.see(actor, tick, plan, own, message)
        return bool(plans)

    def _compare(self, frame: BodyFrame) -> str:
        """What came beside what is expected, for the person who has to make them match."""
        came = [str(body.id if body.name is None else body.name) for body in frame.bodies]
        expected = [str(key) for actor in self.actors for key in actor.expected()]
        return f"it has {', '.join(came[:8]) or 'none'}; expected are {', '.join(expected[:16])}"

    def _push(self, actor: Actor, frame: BodyFrame) -> str:
        restarts = actor.timeline.restarts
        try:
            reason = actor.push(frame)
        except Exception as error:
            self._failed("input", error, [])
            return "internal"
        if actor.timeline.restarts > restarts:
            self._telemetry.count("sender_restarts", source=frame.source.partition(":")[0])
        return reason or _TAKEN

    def _poll(self, actor: Actor, now_s: float) -> Tick | None:
        timeline = actor.timeline
        late, cut = timeline.skipped_late, timeline.skipped_at_restart
        tick = timeline.poll(now_s)
        if timeline.skipped_late > late:
            self._telemetry.count("ticks_skipped", timeline.skipped_late - late, reason="backlog")
        if timeline.skipped_at_restart > cut:
            self._telemetry.count("ticks_skipped", timeline.skipped_at_restart - cut, reason="restart")
        return tick

    def _plan(self, actor: Actor, tick: Tick) -> Plan | None:
        try:
            return actor.plan(tick)
        except Exception as error:
            self._failed("plan", error, [tick])
            return None

    def _synthesise(self, plans: Sequence[Plan]) -> list[HandStep]:
        """The steps of all hands as one batch, in the order of their plans; none at all when synthesis fails."""
        scenes = [scene for plan in plans for scene in plan.scenes.values()]
        memories = [memory for plan in plans for memory in plan.memories.values()]
        self._telemetry.stages.begin()
        try:
            return self._synthesizer.step(scenes, memories)
        except Exception as error:
            self._failed("synthesis", error, [plan.tick for plan in plans])
            return []

    def _hands(
        self, actor: Actor, tick: Tick, plan: Plan | None, steps: Mapping[Side, HandStep]
    ) -> dict[Side, ShownHand]:
        """What the actor shows. On any error the last good pose."""
        if plan is None:
            return actor.hold(tick)
        try:
            return actor.show(plan, steps)
        except Exception as error:
            self._failed("show", error, [tick])
            return actor.hold(tick)

    def _publish_hands(self, actor: Actor, tick: Tick, hands: dict[Side, ShownHand]) -> HandsMessage | None:
        for hand in hands.values():
            self._telemetry.count("hand_ticks", state=hand.shown.state)
        now_s = time.monotonic()
        waited_s, spent_s = tick.look_ahead_s, now_s - tick.waited_for_s
        latency = Latency(buffer=1e3 * waited_s, total=1e3 * (waited_s + spent_s), **self._telemetry.stages.last_ms)
        message = None
        try:
            message = hands_message(self._session, actor, tick, hands, now_s, latency)
            self._publish(message)
        except Exception as error:
            self._failed("publish", error, [tick])
        self._record(actor, now_s, tick.waited_for_s)
        return message

    def _record(self, actor: Actor, started_s: float, waited_for_s: float) -> None:
        now_s = time.monotonic()
        self._telemetry.timings.record("encode", now_s - started_s)
        self._telemetry.timings.record("total", now_s - waited_for_s)
        before_s = self._published_s.get(actor.config.name)
        if before_s is not None:
            self._telemetry.timings.record("interval", now_s - before_s)
        self._published_s[actor.config.name] = now_s

    def _failed(self, stage: str, error: Exception, ticks: list[Tick]) -> None:
        """Count an internal error, leave what led to it in a file, and have all hands go on from what they show."""
        self._telemetry.count("tick_errors", stage=stage)
        path = self._recorder.dump(error, ticks, time.monotonic())
        _log.error("%s failed: %s: %s%s", stage, type(error).__name__, error, f"; see {path}" if path else "")
        for actor in self.actors:
            actor.recover()
