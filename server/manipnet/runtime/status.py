"""What a server says about itself: the second's line, the `status` request, the warnings about silence."""

import logging
import math
from collections.abc import Sequence
from typing import Any, Final

from manipnet.actors.actor import Actor
from manipnet.actors.transitions import state_at_age
from manipnet.telemetry import Telemetry
from manipnet.tracking.tick import BodyHealth

WARN_AFTER_S: Final = 3.0
ERROR_AFTER_S: Final = 10.0
DELAY_PERCENTILES: Final = {"p50": 50.0, "p99": 99.0, "p99.9": 99.9, "max": 100.0}
_log = logging.getLogger(__name__)


def second_line(actors: Sequence[Actor], telemetry: Telemetry, rate_hz: float) -> str:
    """One second of a server in one line: rate, delay, both hands of each actor, what was lost."""
    if not any(actor.receiving for actor in actors):
        return "waiting for bodies: nothing of the rig has arrived yet (`manipnet doctor` says why)"
    p50, p99 = telemetry.timings.recent("total", 50, 99)
    counted = telemetry.counts()
    lost = sum(sum(counted.get(name, {}).values()) for name in ("frames_dropped", "bodies_rejected"))
    parts = [f"{rate_hz:5.1f} frames/s", f"delay {_waited_ms(actors):.0f} + {1e3 * p50:.1f} ms (p99 {1e3 * p99:.1f})"]
    for actor in actors:
        name = f"{actor.config.name}: " if len(actors) > 1 else ""
        parts.append(name + ", ".join(_hand(actor, side) for side in actor.hands))
    return " | ".join([*parts, f"dropped {lost}"])


def status(actors: Sequence[Actor], telemetry: Telemetry, now_s: float) -> dict[str, Any]:
    """Everything about a running server, as plain finite data."""
    delays_s = telemetry.timings.overall("total", *DELAY_PERCENTILES.values())
    return {
        "actors": {actor.config.name: _actor(actor, now_s) for actor in actors},
        "delay_ms": {name: 1e3 * s for name, s in zip(DELAY_PERCENTILES, delays_s, strict=True)},
        "counters": telemetry.counts(),
    }


class SilenceWatch:
    """Says once when a body, or the whole stream, has been lost for long, and when it is back."""

    def __init__(self) -> None:
        self._levels: dict[tuple[str, str], int] = {}

    def look(self, actors: Sequence[Actor], now_s: float) -> None:
        """Compare every body of every actor with what was said of it last."""
        for actor in actors:
            for body, health in actor.health(now_s).items():
                age_s = health.age_s if math.isfinite(health.age_s) else 0.0  # not awaited before it came once
                level = (age_s > WARN_AFTER_S) + (age_s > ERROR_AFTER_S)
                self._say(actor.config.name, body, level, age_s)

    def _say(self, actor: str, body: str, level: int, age_s: float) -> None:
        before = self._levels.get((actor, body), 0)
        self._levels[actor, body] = level
        if level == before:
            return
        if level == 0:
            _log.warning("%s: %s is tracked again", actor, body)
        else:
            report = _log.error if level == 2 else _log.warning
            report("%s: %s has not been tracked for %.0f s", actor, body, age_s)


def _actor(actor: Actor, now_s: float) -> dict[str, Any]:
    hands = {
        side: {"state": hand.shown.state if hand.shown else "rest", "object": hand.prop}
        for side, hand in actor.hands.items()
    }
    bodies = {
        name: {
            "state": state_at_age(health.age_s),
            "age_s": _finite(health.age_s),
            "rate_hz": _finite(health.rate_hz),
        }
        for name, health in (_unheard(actor) | actor.health(now_s)).items()
    }
    return {
        "seq": actor.seq,
        "look_ahead_s": actor.look_ahead_s,
        "paused": actor.paused,
        "hands": hands,
        "bodies": bodies,
        "ticks_skipped": actor.ticks_skipped,
        "sender_restarts": actor.sender_restarts,
    }


def _unheard(actor: Actor) -> dict[str, BodyHealth]:
    """The parts of an actor, as if none had ever been tracked."""
    names = [*actor.config.wrists, *(prop.name for prop in actor.props)]
    return dict.fromkeys(names, BodyHealth(math.nan, math.inf))


def _hand(actor: Actor, side: Any) -> str:
    hand = actor.hands[side]
    if hand.shown is None:
        return f"{side} waiting for its wrist"
    return f"{side} {hand.shown.state}" + (f" {hand.prop}" if hand.prop else "")


def _waited_ms(actors: Sequence[Actor]) -> float:
    return 1e3 * max(actor.look_ahead_s for actor in actors)


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
