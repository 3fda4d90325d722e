"""Reports on a server: one line per second, the answer to `status`, and warnings about lost bodies."""

import logging
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from manipnet.actors.actor import Actor
from manipnet.actors.live_hand import LiveHand
from manipnet.actors.transitions import state_at_age
from manipnet.config.settings import BodyKey
from manipnet.telemetry import Telemetry
from manipnet.tracking.tick import BodyHealth

WAITING: Final = "waiting for bodies: none of the rig yet (`manipnet doctor` says why)"
WARN_AFTER_S: Final = 3.0
ERROR_AFTER_S: Final = 10.0
DELAY_PERCENTILES: Final = {"p50": 50.0, "p99": 99.0, "p99.9": 99.9, "max": 100.0}
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Second:
    """One second of a server: the line that describes it, and what has changed since the last change."""

    status: str
    changes: tuple[str, ...]


class SecondLines:
    """Describes each second of a server in one line, and its changes in lines of their own."""

    def __init__(self, actors: Sequence[Actor], telemetry: Telemetry) -> None:
        self._actors, self._telemetry = actors, telemetry
        self._messages, self._since_s = 0, -math.inf
        """How many messages there were at the last call, and when it was."""
        self._reported: dict[str, str] | None = None
        self._before: dict[str, str] = {}

    def next(self, now_s: float) -> Second:
        """The rate and the delay since the last call, both hands of each actor, and what is down.

        Call this about once per second, with the time. The first hands have no rate yet.

        A hand whose state flickers is not a change until the state has lasted for a second.
        """
        down = [f"{name.upper()} IS DOWN" for name in down_receivers(self._telemetry)]
        return Second(" | ".join([*down, *self._describe(now_s)]), self._changes())

    def _describe(self, now_s: float) -> list[str]:
        before, passed_s = self._messages, now_s - self._since_s
        self._messages, self._since_s = sum(actor.seq for actor in self._actors), now_s
        p50_s = self._telemetry.timings.recent("total", 50)[0]
        if not self._is_receiving():
            return [WAITING]
        hands = [f"{self._name(actor)}{', '.join(map(_hand, actor.hands.values()))}" for actor in self._actors]
        if before == 0:
            return ["the first hands are out", *hands]
        look_ahead_s = max(actor.look_ahead_s for actor in self._actors)
        rate_hz = (self._messages - before) / passed_s
        return [f"{rate_hz:.0f} hands/s", f"delay {1e3 * (look_ahead_s + p50_s):.0f} ms", *hands]

    def _changes(self) -> tuple[str, ...]:
        now = self._state()
        if self._reported is None:
            self._reported = {}
            new = now
        else:
            lasting = now.items() & self._before.items()
            new = {what: text for what, text in lasting if self._reported.get(what) != text}
        self._before = now
        self._reported |= new
        return tuple(new[what] for what in now if what in new)

    def _state(self) -> dict[str, str]:
        """What a change is reported of, in words."""
        down, known = down_receivers(self._telemetry), self._reported or {}
        sockets = {f"socket {name}": f"{name} is down" for name in down}
        sockets |= {
            key: f"{key[7:]} listens again" for key in known if key.startswith("socket ") and key not in sockets
        }
        if not self._is_receiving():
            return {**sockets, "bodies": WAITING}
        hands = {
            f"{actor.config.name} {hand.side}": f"{self._name(actor)}{_hand(hand)}"
            for actor in self._actors
            for hand in actor.hands.values()
        }
        return {**sockets, "bodies": "bodies arrive", **hands}

    def _is_receiving(self) -> bool:
        return any(actor.receiving for actor in self._actors)

    def _name(self, actor: Actor) -> str:
        return f"{actor.config.name}: " if len(self._actors) > 1 else ""


def status(actors: Sequence[Actor], telemetry: Telemetry, now_s: float) -> dict[str, Any]:
    """The state of the actors, the delay and the counters as plain data, in which every number is finite."""
    delays_s = telemetry.timings.overall("total", *DELAY_PERCENTILES.values())
    return {
        "actors": {actor.config.name: _actor(actor, now_s) for actor in actors},
        "delay_ms": {name: 1e3 * delay_s for name, delay_s in zip(DELAY_PERCENTILES, delays_s, strict=True)},
        "counters": telemetry.counts(),
        "drops": telemetry.losses(),
        "receivers": {name: dict(report) for name, report in telemetry.receivers().items()},
    }


def down_receivers(telemetry: Telemetry) -> list[str]:
    """The names of the sockets that have failed and are not open again yet."""
    return [name for name, report in telemetry.receivers().items() if report["state"] == "down"]


class SilenceWatch:
    """Warns once when a body has been lost for long, and reports when it is tracked again."""

    def __init__(self) -> None:
        self._levels: dict[tuple[str, str], int] = {}

    def look(self, actors: Sequence[Actor], now_s: float) -> None:
        """Check every body of every actor. A body that never arrived is not missed."""
        for actor in actors:
            for body, health in actor.health(now_s).items():
                age_s = health.age_s if math.isfinite(health.age_s) else 0.0
                level = (age_s > WARN_AFTER_S) + (age_s > ERROR_AFTER_S)
                self._report(actor.config.name, body, level, age_s)

    def _report(self, actor: str, body: str, level: int, age_s: float) -> None:
        before = self._levels.get((actor, body), 0)
        self._levels[actor, body] = level
        if level == before:
            return
        if level == 0:
            _log.warning("%s: %s is tracked again", actor, body)
        else:
            log = _log.error if level == 2 else _log.warning
            log("%s: %s has not been tracked for %.0f s", actor, body, age_s)


def _actor(actor: Actor, now_s: float) -> dict[str, Any]:
    names = [*actor.config.wrists, *(prop.name for prop in actor.props)]
    return {
        "seq": actor.seq,
        "look_ahead_s": actor.look_ahead_s,
        "paused": actor.paused,
        "hands": {
            side: {"state": hand.shown.state if hand.shown else "rest", "object": hand.prop}
            for side, hand in actor.hands.items()
        },
        "objects": {prop.name: prop.object for prop in actor.props},
        "bodies": bodies_report(names, actor.body_keys(), actor.health(now_s)),
        "ticks_skipped": actor.ticks_skipped,
        "sender_restarts": actor.sender_restarts,
    }


def bodies_report(
    names: Iterable[str], keys: Mapping[str, BodyKey], healths: Mapping[str, BodyHealth]
) -> dict[str, dict[str, Any]]:
    """For each wrist and prop: its body, its state, the age of its newest tracked sample, its rate, and its noise."""
    never_tracked = dict.fromkeys(names, BodyHealth(math.nan, math.inf))
    return {
        name: {
            "body": keys.get(name, name),
            "state": state_at_age(health.age_s),
            "age_s": _finite(health.age_s),
            "rate_hz": _finite(health.rate_hz),
            "noise_m": health.noise.position_m,
            "noise_rad": health.noise.rotation_rad,
        }
        for name, health in (never_tracked | dict(healths)).items()
    }


def _hand(hand: LiveHand) -> str:
    if hand.shown is None:
        return f"{hand.side} waiting for its wrist"
    return f"{hand.side} {hand.shown.state}" + (f" {hand.prop}" if hand.prop else "")


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
