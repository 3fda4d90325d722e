"""What the session is doing, in the words of the page: one verdict, which headline, stage and table share."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from manipnet.tracking.tick import TICK_HZ

Level = Literal["good", "notice", "bad"]
STALE_S: Final = 1.0
"""Bodies and hands that are older than this are not live, whatever was measured before."""

SLOW_HZ: Final = 0.8 * TICK_HZ
"""Motion that has fewer hands a second is seen to stutter."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What an operator has to know first: `text` is a few words, `detail` a sentence."""

    level: Level
    text: str
    detail: str = ""


def verdict(status: Mapping[str, Any], hands_hz: float) -> Verdict:
    """The state of a session from the answer to `status` and the hands that arrive at present."""
    ages = [(part, body["age_s"]) for part, body in _bodies(status)]
    arrived = [(part, age_s) for part, age_s in ages if age_s is not None and math.isfinite(age_s)]
    if not arrived:
        return Verdict("notice", "Waiting for bodies", "no body of the rig has arrived yet")
    newest_s = min(age_s for _, age_s in arrived)
    if newest_s > STALE_S:
        return Verdict("bad", f"No bodies for {duration(newest_s)}", "the sender has stopped, or its network is down")
    if any(actor.get("paused") for actor in status["actors"].values()):
        return Verdict("notice", "Paused", "the hands are held")
    lost = [(part, age_s) for part, age_s in arrived if age_s > STALE_S and part.endswith("_wrist")]
    if lost:
        part, age_s = max(lost, key=lambda each: each[1])
        return Verdict("bad", f"{part} is lost for {duration(age_s)}", f"{hands_hz:.0f} hands/s")
    missing = [part for part, age_s in ages if age_s is None and part.endswith("_wrist")]
    if missing:
        return Verdict("notice", f"Live without {' and '.join(missing)}", f"{hands_hz:.0f} hands/s")
    if 0.0 < hands_hz < SLOW_HZ:  # zero means that they have not been counted yet
        return Verdict(
            "notice", "Live, but too slow", f"{hands_hz:.0f} of {TICK_HZ} hands/s: this computer is too busy"
        )
    return Verdict("good", "Live", f"{hands_hz:.0f} hands/s")


def duration(seconds: float) -> str:
    """A duration in words: milliseconds, seconds, minutes or hours."""
    if seconds < 1.0:
        return f"{1e3 * seconds:.0f} ms"
    if seconds < 600.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 36_000.0 else f"{seconds / 3600.0:.0f} h"


def ago(age_s: float | None) -> str:
    """How long ago something was seen for the last time."""
    return "never" if age_s is None or not math.isfinite(age_s) else f"{duration(age_s)} ago"


def _bodies(status: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    many = len(status["actors"]) > 1
    for name, actor in status["actors"].items():
        for part, body in actor["bodies"].items():
            yield (f"{name}: {part}" if many else part), body
