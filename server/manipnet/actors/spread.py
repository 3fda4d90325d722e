"""Which actors tick half an interval later than the others, so that no hand waits for the hands of all actors."""

from collections.abc import Sequence
from typing import Final

from manipnet.config.settings import ActorConfig
from manipnet.tracking.tick import TICK_S

MANY: Final = 12
"""With fewer actors all tick at once, because every batch costs something of its own."""
LATER_S: Final = 0.4 * TICK_S
"""The later ticks begin at the first frame this much after the first one: half an interval later with 120 frames a
second, and with those of all others at 60, where nothing arrives in between."""


def start_delays_s(actors: Sequence[ActorConfig]) -> list[float]:
    """How long after its first frame each actor begins to tick: half of many actors later than the others.

    Actors that share a body stay together, because hands that hold the same object at the same instant are solved
    together. Whatever requests change later leaves the delays as they are.
    """
    later: set[int] = set()
    if len(actors) >= MANY:
        for group in sorted(_groups(actors), key=len, reverse=True):
            if len(later) + len(group) <= len(actors) // 2:
                later |= group
    return [LATER_S if place in later else 0.0 for place in range(len(actors))]


def _groups(actors: Sequence[ActorConfig]) -> list[set[int]]:
    """The places of actors that share a body with each other, directly or through others."""
    groups: list[tuple[set[int], set[str]]] = []
    for place, actor in enumerate(actors):
        places, bodies = {place}, {str(body.key) for body in actor.bodies().values()}
        for other in [group for group in groups if group[1] & bodies]:
            groups.remove(other)
            places |= other[0]
            bodies |= other[1]
        groups.append((places, bodies))
    return [places for places, _ in groups]
