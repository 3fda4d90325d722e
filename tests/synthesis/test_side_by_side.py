"""Batches that are cut into parts for several cores."""

import os
import threading
from pathlib import Path

import numpy as np
import pytest
from written_scene import scenes_at

from manipnet.synthesis import synthesizer
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.objects.shape import load_shape
from manipnet.synthesis.side_by_side import LEAST_HANDS, MOST_PARTS, SideBySide, cuts, part_count
from manipnet.synthesis.synthesizer import HandStep, Synthesizer


def test_hands_do_not_depend_on_the_number_of_parts(tiny_bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bundle, shapes = load_bundle(tiny_bundle), [load_shape("mug"), load_shape("cube")]

    def steps_in(parts: int) -> list[HandStep]:
        monkeypatch.setattr(synthesizer, "part_count", lambda _: parts)
        solved = Synthesizer(bundle)
        steps, states = [], [solved.rest_state() for _ in range(9)]
        for tick in range(4):
            steps = solved.step(3 * scenes_at(tick, shapes), states)
            states = [step.state for step in steps]
        return steps

    whole = steps_in(1)
    for parts in (2, 4):
        for one, other in zip(whole, steps_in(parts), strict=True):
            np.testing.assert_array_equal(one.angles, other.angles)
            np.testing.assert_array_equal(one.positions, other.positions)
            np.testing.assert_array_equal(one.state.grip, other.state.grip)


def test_hands_that_hold_the_same_are_not_cut_apart() -> None:
    assert cuts("aabbcc", 2) == [0, 4, 6]
    assert cuts("aabbcc", 3) == [0, 2, 4, 6]
    assert cuts("abcdefgh", 4) == [0, 2, 4, 6, 8]
    assert cuts("aaaaaaaa", 4) == [0, 8, 8, 8, 8]


def test_small_batches_are_not_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(64)), raising=False)
    assert [part_count(hands) for hands in (1, 2, 2 * LEAST_HANDS - 1)] == [1, 1, 1]
    assert part_count(2 * LEAST_HANDS) == 2
    assert part_count(1000) == MOST_PARTS
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3}, raising=False)
    assert part_count(1000) == 1


def test_an_error_is_raised_once_every_part_has_ended() -> None:
    ended, first = [], threading.Event()

    def job(part: int) -> None:
        if part == 0:
            first.set()
            raise ZeroDivisionError
        assert first.wait(20.0)
        ended.append(part)

    with pytest.raises(ZeroDivisionError):
        SideBySide().run(job, 3)
    assert sorted(ended) == [1, 2]

    def late(part: int) -> None:
        if part == 2:
            raise KeyError

    with pytest.raises(KeyError):
        SideBySide().run(late, 3)
