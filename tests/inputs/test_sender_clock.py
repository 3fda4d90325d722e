"""The clocks of a sender: which of them is believed, and when."""

import random
from itertools import pairwise

import pytest

from manipnet.inputs.sender_clock import SenderClock

HZ = 120


def drive(*stated, seconds=4.0, hz=HZ, arrive=lambda t_s: t_s, names=("tag", "stamp")):
    """Frames at `hz` whose clocks state what the functions `stated` say; returns the clock and `(sent, time)`s."""
    clock, times = SenderClock(names[: len(stated)]), []
    sent = [n / hz for n in range(round(seconds * hz))]
    for arrived_s, t_s in sorted((arrive(t_s), t_s) for t_s in sent):
        values = tuple(state(t_s) for state in stated)
        for each, value in zip(clock.clocks, values, strict=True):
            if value is not None:
                each.note(value, 50.0 + arrived_s)
        times.append((t_s, clock.choose(values, 50.0 + arrived_s, repeats=False)))
    return clock, times


def right(t_s):
    return 7_000.0 + t_s


WRONG = {
    "zero": lambda t_s: 0.0,
    "a constant": lambda t_s: 1_234.5,
    "whole seconds": lambda t_s: float(int(t_s)) + 0.25,
    "a thousand times too fast": lambda t_s: 1e3 * t_s,
    "a thousand times too slow": lambda t_s: 1e-3 * t_s,
    "ticks of 90 kHz as milliseconds": lambda t_s: 90.0 * t_s,
    "nanoseconds": lambda t_s: 1e9 * t_s,
    "backwards": lambda t_s: -t_s,
    "milliseconds as a raw time tag": lambda t_s: -2_208_988_800.0 + t_s * 1e3 / 2**32,
    "tenths of a second": lambda t_s: int(10 * t_s) / 10,
    "random numbers": lambda t_s: random.Random(int(1e6 * t_s)).uniform(0.0, 1e9),
    "frame numbers": lambda t_s: t_s * HZ,
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_clock_gives_way_to_the_next_one(wrong):
    clock, times = drive(WRONG[wrong], right)
    assert clock.used == "stamp"
    assert "tag" in clock.set_aside()
    followed = [t_s for sent_s, t_s in times if t_s == right(sent_s)]
    assert len(followed) > 0.8 * len(times)


@pytest.mark.parametrize("wrong", WRONG)
def test_without_another_clock_the_arrivals_count(wrong):
    clock, times = drive(WRONG[wrong])
    assert clock.used == "arrival"
    assert times[-1][1] == pytest.approx(50.0 + times[-1][0], abs=1e-9)


@pytest.mark.parametrize(
    "good",
    [
        right,
        lambda t_s: -5_000.0 + t_s,  # another epoch
        lambda t_s: 2_208_988_800.0 + t_s,
        lambda t_s: 0.2 * t_s,  # a slow replay
        lambda t_s: 4.0 * t_s,
        lambda t_s: round(1e3 * t_s) / 1e3,  # whole milliseconds
        lambda t_s: round(250.0 * t_s) / 250.0,  # a float32 of milliseconds after nine hours
        lambda t_s: 86_399.0 + t_s if t_s < 1.0 else t_s - 1.0,  # midnight
        lambda t_s: t_s % 1.5,  # a short counter that wraps around
    ],
)
def test_a_clock_that_runs_is_believed_from_the_first_frame_to_the_last(good):
    clock, times = drive(good)
    assert clock.used == "tag"
    assert [t_s for _, t_s in times] == [good(sent_s) for sent_s, _ in times]


@pytest.mark.parametrize(
    "arrive",
    [
        lambda t_s: t_s + 0.1 * random.Random(int(1e6 * t_s)).random(),  # jitter, and the wrong order
        lambda t_s: (int(t_s * HZ) // 12 + 1) * 12 / HZ,  # in bunches
        lambda t_s: t_s if not 1.0 < t_s < 3.0 else 3.0,  # nothing for two seconds, and then everything at once
        lambda t_s: t_s if not 0.02 < t_s < 0.3 else 0.3,
    ],
)
def test_a_bad_network_does_not_discredit_a_clock(arrive):
    clock, times = drive(right, arrive=arrive)
    assert clock.used == "tag"
    assert all(t_s == right(sent_s) for sent_s, t_s in times)


def test_a_clock_that_stops_is_set_aside_and_one_that_runs_again_is_used_again():
    def stuck(t_s):
        return right(min(t_s, 1.0)) if t_s < 2.0 else right(t_s)

    clock, times = drive(stuck)
    used = [t_s == stuck(sent_s) for sent_s, t_s in times]
    assert all(used[: int(1.0 * HZ)])
    assert not any(used[int(1.1 * HZ) : int(2.0 * HZ)])
    assert all(used[int(2.8 * HZ) :])
    assert clock.set_aside() == {}


def test_a_clock_that_is_no_longer_stated_is_forgotten_only_when_asked():
    clock, times = drive(lambda t_s: right(t_s) if t_s < 1.0 else None, right)
    assert {t_s for sent_s, t_s in times if sent_s >= 1.0} == {None}
    clock.forget()
    assert clock.choose((None, 5.0), 60.0, repeats=False) == 5.0


def test_arrivals_in_bunches_are_spread_by_the_usual_interval():
    _, times = drive(lambda t_s: None, arrive=lambda t_s: (int(t_s * HZ) // 3 + 1) * 3 / HZ)
    steps = [b - a for (_, a), (_, b) in pairwise(times[6:])]
    assert min(steps) > 0.5 / HZ
    assert max(steps) < 2.0 / HZ
    assert all(t_s <= 50.0 + sent_s + 0.1 for sent_s, t_s in times)


def test_a_frame_that_arrives_twice_is_not_spread():
    clock = SenderClock(("tag",))
    times = [clock.choose((None,), n // 2 / HZ, repeats=n % 2 == 1) for n in range(20)]
    assert times[::2] == times[1::2]
