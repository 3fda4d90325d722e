"""Which actors tick later than the others."""

from dataclasses import replace
from pathlib import Path

import pytest

from manipnet.actors.spread import LATER_S, MANY, start_delays_s
from manipnet.config.settings import ActorConfig, BodyConfig, ObjectConfig


def cast(count: int, shared: dict[int, int | str]) -> list[ActorConfig]:
    """Actors with two wrists each and, by their number, the body of a prop."""
    actors = [
        ActorConfig(f"a{n}", {"left_wrist": BodyConfig(2 * n), "right_wrist": BodyConfig(2 * n + 1)})
        for n in range(count)
    ]
    for n, body in shared.items():
        prop = ObjectConfig(f"prop{n}", BodyConfig(body), Path("cube"))
        actors[n] = replace(actors[n], objects=(*actors[n].objects, prop))
    return actors


@pytest.mark.parametrize("count", [1, 2, 4, MANY - 1])
def test_few_actors_tick_at_once(count: int) -> None:
    assert start_delays_s(cast(count, {})) == [0.0] * count


@pytest.mark.parametrize("count", [MANY, 16])
def test_half_of_many_actors_tick_later(count: int) -> None:
    assert sorted(start_delays_s(cast(count, {}))) == [0.0] * (count // 2) + [LATER_S] * (count // 2)


def test_actors_that_share_a_body_stay_together() -> None:
    actors = cast(16, {0: "box", 9: "box", 3: 100, 5: "100", 12: 7})  # 100 and "100" are one body; 7 is a wrist of 3
    delays = start_delays_s(actors)
    assert delays[0] == delays[9]
    assert delays[3] == delays[5] == delays[12]
    assert 6 <= delays.count(LATER_S) <= 8


def test_actors_that_all_share_a_body_tick_at_once() -> None:
    assert start_delays_s(cast(16, dict.fromkeys(range(16), "stage"))) == [0.0] * 16
