"""Stream time: every tick comes out once, at its own instant, whatever the sender does."""

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from manipnet.geometry import Array, quat_exp, quat_log, quat_multiply, quat_normalize
from manipnet.synthesis.model.layout import WINDOW_OFFSETS_S
from manipnet.tracking.arrivals import SILENCE_S
from manipnet.tracking.tick import TICK_S, Tick
from manipnet.tracking.timeline import MAX_BACKLOG, Timeline

VELOCITY = np.array([0.3, -0.2, 0.1])
SPIN = np.array([0.5, 1.5, -0.7])
START = quat_normalize(np.array([0.1, -0.4, 0.2, 0.8]))


def screw(t_s: Array | float) -> Array:
    """A motion of constant velocity and constant spin, which linear and spherical interpolation reproduce."""
    t = np.asarray(t_s, dtype=np.float64)[..., None]
    q = quat_multiply(quat_exp(SPIN * t), np.broadcast_to(START, (*t.shape[:-1], 4)))
    return np.concatenate([VELOCITY * t, q], axis=-1)


def same_pose(a: Array, b: Array, tolerance: float = 1e-9) -> bool:
    sign = np.sign(np.sum(a[..., 3:] * b[..., 3:], axis=-1, keepdims=True))
    return bool(
        np.allclose(a[..., :3], b[..., :3], atol=tolerance)
        and np.allclose(a[..., 3:] * sign, b[..., 3:], atol=tolerance)
    )


def test_a_body_of_which_nothing_comes_any_more_has_no_rate() -> None:
    timeline = Timeline(0.1)
    for k in range(240):
        timeline.push(k / 120, {"body": screw(k / 120)}, k / 120)
    last_s = 239 / 120
    assert timeline.health(last_s)["body"].rate_hz == pytest.approx(120.0)
    silent = timeline.health(last_s + 530.0)["body"]
    assert (silent.rate_hz, silent.age_s) == (0.0, pytest.approx(530.0))


def drain(timeline: Timeline, now_s: float) -> list[Tick]:
    ticks = []
    while (tick := timeline.poll(now_s)) is not None:
        ticks.append(tick)
    return ticks


def stream(timeline: Timeline, times_s: Iterable[float], start_s: float = 100.0, speed: float = 1.0) -> list[Tick]:
    """Push frames that arrive as they were captured, `start_s` later by our clock; returns the ticks."""
    ticks = []
    for t in times_s:
        now = start_s + t / speed
        ticks += drain(timeline, now)
        timeline.push(t, {"body": screw(t)}, now)
        ticks += drain(timeline, now)
    return ticks


def carry_on(timeline: Timeline, from_s: float, to_s: float) -> list[Tick]:
    """Ticks without further frames, polled exactly when the timeline asks for it."""
    ticks = []
    while (now := timeline.next_poll_s(from_s)) <= to_s:
        ticks += drain(timeline, now)
        from_s = now
    return ticks


def whole_take(rate_hz: float, seconds: float, look_ahead_s: float = 0.5, speed: float = 1.0) -> list[Tick]:
    timeline = Timeline(look_ahead_s)
    times = np.arange(int(seconds * rate_hz) + 1) / rate_hz
    ticks = stream(timeline, times, speed=speed)
    end = 100.0 + times[-1] / speed
    return ticks + carry_on(timeline, end, end + 0.5)


@given(rate_hz=st.floats(30.0, 360.0), look_ahead_s=st.floats(0.0, 0.5), speed=st.sampled_from([0.5, 1.0, 4.0]))
@settings(max_examples=30, deadline=None)
def test_every_tick_of_a_take_comes_out_once(rate_hz: float, look_ahead_s: float, speed: float) -> None:
    ticks = whole_take(rate_hz, 2.0, look_ahead_s, speed)
    last_frame_s = int(2.0 * rate_hz) / rate_hz
    of_the_take = [tick for tick in ticks if tick.time_s <= last_frame_s + 1e-6]
    assert [tick.index for tick in ticks] == list(range(len(ticks)))
    assert len(of_the_take) == int(last_frame_s * 60 + 1e-6) + 1
    assert np.allclose([tick.time_s for tick in ticks], np.arange(len(ticks)) / 60)


@given(rate_hz=st.floats(30.0, 360.0))
@settings(max_examples=20, deadline=None)
def test_resampling_a_screw_motion_is_exact_at_any_rate(rate_hz: float) -> None:
    for tick in whole_take(rate_hz, 1.5):
        if 0.5 <= tick.time_s <= 1.5 - 0.5 - 1.0 / rate_hz:
            assert same_pose(tick.bodies["body"].window, screw(tick.time_s + WINDOW_OFFSETS_S))
            assert same_pose(tick.bodies["body"].pose, screw(tick.time_s))


@given(
    gaps_s=st.lists(st.floats(0.002, 0.05), min_size=60, max_size=60),
    order=st.randoms(use_true_random=False),
    flips=st.integers(0, 2**60),
)
@settings(max_examples=20, deadline=None)
def test_jitter_reordering_and_sign_flips_change_nothing(gaps_s: list[float], order, flips: int) -> None:
    times: list[float] = np.cumsum(gaps_s).tolist()
    now = 0.0
    arrivals = [i for block in np.array_split(np.arange(60), 15) for i in order.sample(list(block), len(block))]
    timeline = Timeline()
    ticks: list[Tick] = []
    for n, i in enumerate(arrivals):
        pose = screw(times[i])
        pose[3:] *= -1.0 if flips >> n & 1 else 1.0
        now = 10.0 + times[int(max(arrivals[: n + 1]))]
        timeline.push(times[i], {"body": pose}, now)
    ticks += carry_on(timeline, now, now + 0.5)
    tick = next(t for t in ticks if t.time_s <= times[-1])
    instants = tick.time_s + WINDOW_OFFSETS_S
    inside = (times[0] <= instants) & (instants <= times[-1])
    assert same_pose(tick.bodies["body"].window[inside], screw(instants[inside]), 1e-6)


@pytest.mark.parametrize(("rate_hz", "first_s"), [(60.0, 1 / 60), (100.0, 0.01), (120.0, 1 / 120), (360.0, 1 / 120)])
@pytest.mark.parametrize("look_ahead_s", [0.0, 0.1])
def test_ticks_that_begin_later_are_as_even_and_none_is_missing(
    rate_hz: float, first_s: float, look_ahead_s: float
) -> None:
    timeline = Timeline(look_ahead_s, start_delay_s=0.4 * TICK_S)
    ticks = stream(timeline, np.arange(rate_hz) / rate_hz)
    assert np.allclose([tick.time_s for tick in ticks], first_s + np.arange(len(ticks)) / 60)
    assert len(ticks) == pytest.approx((1.0 - look_ahead_s) * 60, abs=1.5)
    assert not any(tick.silent for tick in ticks)
    restarted = stream(timeline, 1e4 + np.arange(rate_hz) / rate_hz, start_s=101.0 - 1e4)
    own = [tick for tick in restarted if tick.run == 1]
    assert np.allclose([tick.time_s for tick in own], 1e4 + first_s + np.arange(len(own)) / 60)


def test_a_tick_that_is_due_already_is_to_be_polled_now() -> None:
    timeline = Timeline(0.1)
    for k in range(24):
        timeline.push(k / 120, {"body": screw(k / 120)}, k / 120)
    now_s = 23 / 120
    while timeline.next_poll_s(now_s) == now_s:
        assert timeline.poll(now_s) is not None
    assert timeline.poll(now_s) is None
    assert now_s < timeline.next_poll_s(now_s) < now_s + SILENCE_S + TICK_S


def test_a_stream_of_a_single_frame_ticks_by_our_clock_after_a_delay_as_well() -> None:
    timeline = Timeline(0.0, start_delay_s=0.4 * TICK_S)
    ticks = stream(timeline, [0.0]) + carry_on(timeline, 100.0, 100.2)
    ticks += stream(timeline, np.arange(0.2, 0.4, 1 / 120))
    assert [tick.index for tick in ticks] == list(range(len(ticks)))
    assert np.allclose([tick.time_s for tick in ticks], 0.4 * TICK_S + np.arange(len(ticks)) / 60)


def test_a_rate_change_is_followed() -> None:
    times = np.concatenate([np.arange(0, 1, 1 / 30), np.arange(1, 2, 1 / 360), np.arange(2, 3, 1 / 60)])
    timeline = Timeline()
    ticks = stream(timeline, times)
    assert [tick.index for tick in ticks] == list(range(len(ticks)))
    assert all(same_pose(tick.bodies["body"].pose, screw(tick.time_s)) for tick in ticks)


def test_the_window_is_clamped_where_history_is_missing() -> None:
    first = whole_take(120.0, 1.0)[0]
    assert first.time_s == 0.0
    assert same_pose(first.bodies["body"].window[:11], np.broadcast_to(screw(0.0), (11, 7)))
    assert same_pose(first.bodies["body"].pose, screw(0.0))


def test_the_window_is_clamped_where_the_take_ends() -> None:
    last = [tick for tick in whole_take(120.0, 1.0) if tick.time_s <= 1.0 + 1e-6][-1]
    assert last.silent
    assert same_pose(last.bodies["body"].window[11:], np.broadcast_to(screw(1.0), (10, 7)))


@pytest.mark.parametrize("look_ahead_s", [0.0, 0.1, 0.3, 0.5])
def test_a_tick_falls_due_with_the_frame_that_completes_its_look_ahead(look_ahead_s: float) -> None:
    timeline = Timeline(look_ahead_s)
    for i in range(240):
        t = i / 120
        timeline.push(t, {"body": screw(t)}, 50.0 + t)
        for tick in drain(timeline, 50.0 + t):
            needed = tick.time_s + look_ahead_s
            assert needed <= t + 1e-6 < needed + 1 / 120 + 1e-5
            assert tick.waited_for_s == 50.0 + t


def test_a_tick_that_is_polled_late_tells_when_it_was_due() -> None:
    timeline = Timeline(0.1)
    for i in range(60):
        timeline.push(i / 120, {"body": screw(i / 120)}, 50.0 + i / 120)
    for tick in drain(timeline, 51.0)[:20]:
        assert tick.waited_for_s == pytest.approx(50.0 + tick.time_s + 0.1, abs=1e-6)


def test_beyond_the_look_ahead_the_future_is_forecast() -> None:
    tick = whole_take(120.0, 1.5, look_ahead_s=0.1)[60]
    window, truth = tick.bodies["body"].window, screw(tick.time_s + WINDOW_OFFSETS_S)
    assert same_pose(window[:13], truth[:13])
    error = np.linalg.norm(window[13:, :3] - truth[13:, :3], axis=1)
    standing = np.linalg.norm(window[12, :3] - truth[13:, :3], axis=1)
    assert np.all(error < standing)
    assert error[0] < 0.2 * standing[0]


def test_samples_past_the_look_ahead_are_not_used_even_if_they_have_arrived() -> None:
    """A burst of frames must give what a steady stream gives."""
    burst = Timeline(0.1)
    for i in range(61):
        burst.push(i / 120, {"body": screw(i / 120)}, 10.0)
    steady = stream(Timeline(0.1), np.arange(61) / 120)
    for a, b in zip(drain(burst, 10.0), steady, strict=True):
        assert np.array_equal(a.bodies["body"].window, b.bodies["body"].window)


def test_our_clock_carries_the_ticks_through_a_silence_and_none_is_missing_after_it() -> None:
    timeline = Timeline()
    before = stream(timeline, np.arange(121) / 120)
    during = carry_on(timeline, 101.0, 103.0)
    assert during[0].index == before[-1].index + 1
    assert np.diff([tick.index for tick in during]).tolist() == [1] * (len(during) - 1)
    assert 60 * (2.0 - 0.5) <= len(during) - 30 <= 60 * 1.5 + 1
    assert during[-1].bodies["body"].age_s == pytest.approx(103.0 - 101.0 - 0.5, abs=2 * TICK_S)
    assert np.isfinite(during[-1].bodies["body"].window).all()
    after = stream(timeline, 3.0 + np.arange(121) / 120)
    assert [tick.index for tick in during + after] == list(range(during[0].index, after[-1].index + 1))
    assert timeline.restarts == timeline.skipped_late == 0


def test_a_short_pause_of_arrivals_is_not_a_silence() -> None:
    timeline = Timeline()
    stream(timeline, np.arange(121) / 120)
    assert drain(timeline, 101.0 + SILENCE_S - 1e-3) == []


@pytest.mark.parametrize("rate_hz", [30.0, 120.0])
def test_a_slow_replay_is_not_a_silence(rate_hz: float) -> None:
    timeline = Timeline()
    ticks = stream(timeline, np.arange(int(2 * rate_hz)) / rate_hz, speed=0.25)
    assert not any(tick.silent for tick in ticks)


@pytest.mark.parametrize("pause_s", [0.3, 3.0])
def test_a_sender_that_paused_and_resumes_is_followed_again(pause_s: float) -> None:
    timeline = Timeline()
    ticks = stream(timeline, np.arange(121) / 120)
    ticks += carry_on(timeline, 101.0, 101.0 + pause_s)
    polled = []
    for i in range(121, 600):
        t, now = i / 120, 101.0 + pause_s + (i - 120) / 120
        while (due := timeline.next_poll_s(now - 1 / 120)) < now:
            polled += [(due, tick) for tick in drain(timeline, due)]
        timeline.push(t, {"body": screw(t)}, now)
        polled += [(now, tick) for tick in drain(timeline, now)]
    gaps = np.diff([now for now, _ in polled])
    assert gaps.max() < 1.6 * TICK_S, "publishing must not stop while the sender catches up"
    _, last = polled[-1]
    assert last.time_s == pytest.approx(599 / 120 - 0.5, abs=TICK_S)
    assert not last.silent


def test_a_sender_that_was_late_and_catches_up_loses_and_repeats_no_tick() -> None:
    timeline = Timeline()
    ticks = stream(timeline, np.arange(121) / 120)
    ticks += carry_on(timeline, 101.0, 104.0)
    for i in range(121, 601):  # three seconds of frames arrive within a tenth of a second, then frames arrive as usual
        now = 104.0 + (i - 120) / 4800 if i < 481 else 104.0 + (i - 480) / 120
        timeline.push(i / 120, {"body": screw(i / 120)}, now)
        ticks += drain(timeline, now)
    assert [tick.index for tick in ticks] == list(range(len(ticks)))
    assert not ticks[-1].silent
    assert timeline.restarts == timeline.skipped_late == 0


def test_a_sender_restart_plays_out_the_old_run_and_begins_a_new_one() -> None:
    """The player loops: time goes back to zero without a pause, and no tick of either pass is lost."""
    timeline = Timeline()
    ticks = stream(timeline, np.arange(121) / 120, start_s=100.0)
    ticks += stream(timeline, np.arange(121) / 120, start_s=101.0 + 1 / 120)
    ticks += carry_on(timeline, 102.0 + 1 / 120, 102.5 + 1 / 120)
    for run in (0, 1):
        own = [tick for tick in ticks if tick.run == run and tick.time_s <= 1.0 + 1e-6]
        assert [tick.index for tick in own] == list(range(61))
    assert [tick.run for tick in ticks] == sorted(tick.run for tick in ticks)
    assert timeline.restarts == 1
    assert timeline.skipped_late == timeline.skipped_at_restart == 0


def test_one_bad_time_stamp_moves_nothing() -> None:
    timeline = Timeline()
    stream(timeline, np.arange(60) / 120)
    for bad in (-1e9, 0.5 + 7.0, 1e9):
        assert timeline.push(bad, {"body": screw(0.0)}, 100.5) == "time_jump"
    assert timeline.push(0.5, {"body": screw(0.5)}, 100.5) is None
    assert timeline.restarts == 0


def test_a_frame_that_was_delayed_too_long_is_late() -> None:
    timeline = Timeline()
    stream(timeline, np.arange(600) / 120)
    assert timeline.push(4.2, {"body": screw(4.2)}, 105.0) == "late"
    assert timeline.push(5.0, {"body": screw(5.0)}, 105.0) is None
    assert timeline.restarts == 0


def test_a_second_sender_is_refused_until_the_first_falls_silent() -> None:
    timeline = Timeline()
    for i in range(120):
        now = 10.0 + i / 120
        assert timeline.push(i / 120, {"body": screw(i / 120)}, now, "osc:a") is None
        assert timeline.push(900 + i / 120, {"body": screw(i / 120)}, now, "osc:b") == "other_sender"
    reasons = [timeline.push(910 + i / 120, {"body": screw(i / 120)}, 12.0 + i / 120, "osc:b") for i in range(5)]
    assert reasons == ["time_jump", "time_jump", None, None, None]


def test_two_senders_may_share_an_actor_if_they_share_a_clock_and_no_body() -> None:
    timeline = Timeline(0.0)
    for i in range(120):
        t, now = i / 120, 10.0 + i / 120
        assert timeline.push(t, {"wrist": screw(t)}, now, "osc:a") is None
        assert timeline.push(t, {"prop": screw(t)}, now, "osc:b") is None
        assert timeline.push(t, {"wrist": screw(0.0)}, now, "osc:c") == "other_sender"
        assert timeline.push(t + 50, {"cup": screw(t)}, now, "osc:d") == "other_sender"
    tick = drain(timeline, 11.0)[0]
    assert set(tick.bodies) == {"wrist", "prop"}
    assert same_pose(tick.bodies["wrist"].pose, screw(tick.time_s))


def test_two_senders_with_one_name_do_not_fight_over_the_clock() -> None:
    timeline = Timeline()
    for i in range(120):
        now = 10.0 + i / 120
        assert timeline.push(i / 120, {"body": screw(i / 120)}, now, "zmq") is None
        assert timeline.push(900 + i / 120, {"body": screw(i / 120)}, now, "zmq") == "time_jump"
    assert timeline.restarts == 0


def test_ticks_do_not_wait_for_a_body_that_vanished() -> None:
    timeline = Timeline(0.0)
    for i in range(240):
        bodies = {"body": screw(i / 120)} | ({"prop": screw(i / 120)} if i < 120 else {})
        timeline.push(i / 120, bodies, 10.0 + i / 120)
        ticks = drain(timeline, 10.0 + i / 120)
        if i > 123:
            assert len(ticks) == (i % 2 == 0)
    assert tick_age(ticks or drain(timeline, 12.1), "prop") > 0.9


def tick_age(ticks: list[Tick], body: str) -> float:
    return ticks[-1].bodies[body].age_s


def test_ticks_wait_for_a_body_that_comes_in_its_own_message() -> None:
    timeline = Timeline(0.0)
    for i in range(40):
        timeline.push(i / 60, {"body": screw(i / 60)}, 10.0 + i / 60)
        if i > 2:
            assert drain(timeline, 10.0 + i / 60) == []
        timeline.push(i / 60, {"prop": screw(i / 60)}, 10.001 + i / 60)
        drain(timeline, 10.001 + i / 60)


def test_an_untracked_body_keeps_time_but_gives_no_pose() -> None:
    timeline = Timeline()
    for i in range(121):
        timeline.push(i / 120, {"body": screw(i / 120) if i < 60 else None, "other": None}, 10.0 + i / 120)
    ticks = drain(timeline, 11.0)
    assert "other" not in ticks[-1].bodies
    assert ticks[-1].bodies["body"].age_s == pytest.approx(ticks[-1].time_s - 59 / 120)


def test_a_large_backlog_is_skipped_and_counted() -> None:
    timeline = Timeline()
    for i in range(360):
        timeline.push(i / 120, {"body": screw(i / 120)}, 10.0)
    ticks = drain(timeline, 10.0)
    assert len(ticks) + timeline.skipped_late == 150
    assert timeline.skipped_late > MAX_BACKLOG


@pytest.mark.parametrize(("before", "after"), [(0.5, 0.1), (0.0, 0.5)])
def test_a_changed_look_ahead_is_reached_without_missing_or_stopping(before: float, after: float) -> None:
    timeline = Timeline(before)
    stream(timeline, np.arange(120) / 120)
    timeline.look_ahead_s = after
    ticks = stream(timeline, np.arange(120, 600) / 120)
    assert np.diff([tick.index for tick in ticks]).tolist() == [1] * (len(ticks) - 1)
    assert np.diff([tick.waited_for_s for tick in ticks]).max() < 1.6 * TICK_S
    assert ticks[-1].look_ahead_s == pytest.approx(after)


def test_the_log_of_rotation_in_a_window_is_steady() -> None:
    """No neighbouring window samples lie on opposite hemispheres, whatever signs the sender used."""
    tick = whole_take(120.0, 1.5)[45]
    q = tick.bodies["body"].window[:, 3:]
    steps = quat_log(quat_multiply(q[1:], q[:-1] * np.array([-1, -1, -1, 1])))
    assert np.allclose(steps[:-1], SPIN * 0.05, atol=1e-6)


@pytest.mark.parametrize("drift", [-1e-4, 1e-4])
def test_a_senders_clock_may_drift_from_ours(drift: float) -> None:
    """Ticks follow the sender's time, and each comes with the frame that completes it, so no delay builds up."""
    timeline = Timeline(0.1)
    ticks: list[tuple[float, Tick]] = []
    for i in range(20 * 60):
        now = 500.0 + i / 60 * (1.0 + drift)
        ticks += [(now, tick) for tick in drain(timeline, now)]
        timeline.push(i / 60, {"body": screw(i / 60)}, now)
        ticks += [(now, tick) for tick in drain(timeline, now)]
    assert [tick.index for _, tick in ticks] == list(range(len(ticks)))
    assert len(ticks) == 20 * 60 - 6
    for now, tick in ticks:
        assert now == pytest.approx(500.0 + (tick.time_s + 0.1) * (1.0 + drift), abs=1e-6)
        assert not tick.silent


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_lost_frames_cost_no_tick_and_no_accuracy(share: float) -> None:
    chance = np.random.default_rng(5)
    times = [i / 120 for i in range(361) if i in (0, 360) or chance.random() > share]
    ticks = stream(Timeline(), times)
    assert [tick.index for tick in ticks] == list(range(len(ticks)))
    assert len(ticks) >= 60 * 2.5
    assert all(same_pose(tick.bodies["body"].pose, screw(tick.time_s)) for tick in ticks)


def test_a_frame_that_comes_twice_is_used_once() -> None:
    timeline, single = Timeline(), Timeline()
    for i in range(121):
        t, now = i / 120, 10.0 + i / 120
        assert timeline.push(t, {"body": screw(t)}, now) is None
        assert timeline.push(t, {"body": screw(t + 0.3)}, now + 1e-3) == "duplicate"
        assert single.push(t, {"body": screw(t)}, now) is None
    for a, b in zip(drain(timeline, 11.001), drain(single, 11.001), strict=True):
        assert np.array_equal(a.bodies["body"].window, b.bodies["body"].window)


def test_a_frame_that_comes_late_still_serves_the_past_of_the_window() -> None:
    timeline, punctual = Timeline(), Timeline()
    late: list[tuple[float, float]] = []
    for i in range(121):
        t, now = i / 120, 10.0 + i / 120
        punctual.push(t, {"body": screw(t)}, now)
        if i % 3 == 1:
            late.append((t, now + 0.3))
        else:
            timeline.push(t, {"body": screw(t)}, now)
        while late and late[0][1] <= now:
            assert timeline.push(late[0][0], {"body": screw(late.pop(0)[0])}, now) is None
    for a, b in zip(drain(timeline, 11.0), drain(punctual, 11.0), strict=True):
        assert same_pose(a.bodies["body"].window, b.bodies["body"].window)


@given(st.lists(st.floats(0.002, 0.04), min_size=20, max_size=120), st.sampled_from([0.0, 0.1, 0.5]))
def test_a_tick_falls_due_with_the_awaited_frame_and_with_none_before(gaps: list[float], look_ahead_s: float) -> None:
    timeline = Timeline(look_ahead_s)
    assert timeline.awaited() is None
    t_s = 0.0
    timeline.push(t_s, {"body": screw(t_s)}, t_s, "sender")
    drain(timeline, t_s)
    for gap in gaps:
        t_s += gap
        awaited = timeline.awaited()
        assert awaited is not None
        timeline.push(t_s, {"body": screw(t_s)}, t_s, "sender")
        assert bool(drain(timeline, t_s)) == (t_s >= awaited[1])
        assert awaited[0] == "sender"
