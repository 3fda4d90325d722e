"""Smoothing takes out noise and nothing else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_tracking import at_rest, differences, fall, hand_motion, shaken

from manipnet.geometry import Array
from manipnet.synthesis.model.layout import PRESENT, WINDOW_OFFSETS_S
from manipnet.tracking.noise import SPAN_S, UNKNOWN, Noise
from manipnet.tracking.pose_buffer import PoseBuffer, sample
from manipnet.tracking.smoothing import CLEAN_M, FOLLOW_TICKS, Smoother, Smoothing, smooth
from manipnet.tracking.tick import Tick
from manipnet.tracking.timeline import Timeline

NOISE_M, NOISE_RAD = 1e-3, np.radians(0.5)
USUAL = Smoothing(share=1.0, noise=1.0, half_width_s=0.08)
CLASSES = [(1.0, 0.5, 120.0), (1.0, 0.5, 60.0), (2.0, 1.0, 90.0), (2.0, 1.0, 240.0)]


def interpolated(times: Array, poses: Array, at: Array) -> Array:
    track = PoseBuffer()
    for t, pose in zip(times, poses, strict=True):
        track.add(float(t), pose)
    return sample([track], at, at[0], times[-1], None)[0][0]


def smoothed(times: Array, poses: Array, at: Array, smoothing: Smoothing = USUAL) -> Array:
    out = interpolated(times, poses, at)
    smooth(times, poses, smoothing, at, out)
    return out


def ticks_of(times: Array, poses: dict[str, Array], look_ahead_s: float = 0.5) -> list[Tick]:
    timeline, ticks = Timeline(look_ahead_s), []
    for i, t in enumerate(times.tolist()):
        timeline.push(t, {name: of[i] for name, of in poses.items()}, t)
        while (tick := timeline.poll(t)) is not None:
            ticks.append(tick)
    return ticks


@given(
    gaps_s=st.lists(st.floats(0.004, 0.02), min_size=100, max_size=100),
    half_width_s=st.floats(0.05, 0.15),
    share=st.floats(0.0, 1.0),
)
@settings(max_examples=30, deadline=None)
def test_constant_acceleration_and_spin_pass_unchanged(gaps_s: list[float], half_width_s: float, share: float) -> None:
    times = np.cumsum(gaps_s)
    at = times[20:]  # to the very end, where only the past is known: nothing lags
    out = smoothed(times, fall(times), at, Smoothing(share, 1.0, half_width_s))
    shift, turn = differences(out, fall(at))
    assert np.abs(shift).max() < 1e-9
    assert np.abs(turn).max() < 1e-9


@pytest.mark.parametrize("at_end", [False, True])
def test_the_noise_of_a_body_at_rest_falls_as_the_kernel_says(at_end: bool) -> None:
    rate_hz, h = 120.0, USUAL.half_width_s
    left = 3 * h if at_end else h
    offsets = np.arange(-int(left * rate_hz), 1 if at_end else int(h * rate_hz) + 1) / rate_hz
    weights = (1.0 - (offsets / left) ** 2) ** 2
    powers = offsets[:, None] ** np.arange(3)
    kernel = np.linalg.solve(powers.T @ (weights[:, None] * powers), powers.T * weights)[0]
    expected = np.sqrt((kernel**2).sum())
    found = []
    for seed in range(100):
        times = np.arange(60) / rate_hz
        at = times[-1:] if at_end else times[30:31]
        out = smoothed(times, shaken(at_rest(times), NOISE_M, NOISE_RAD, seed), at)
        shift, turn = differences(out, at_rest(at))
        found.append([*shift[0] / NOISE_M, *turn[0] / NOISE_RAD])
    assert np.std(found) == pytest.approx(expected, rel=0.12)
    assert expected < (0.65 if at_end else 0.4)


@pytest.mark.parametrize(("mm", "degrees", "rate_hz"), CLASSES)
def test_a_noisy_stream_becomes_calm(mm: float, degrees: float, rate_hz: float) -> None:
    times = np.arange(int(4.0 * rate_hz)) / rate_hz
    poses = shaken(at_rest(times), 1e-3 * mm, np.radians(degrees))
    ticks = [tick for tick in ticks_of(times, {"body": poses}) if tick.time_s > 2.0]
    shown = np.array([tick.bodies["body"].pose for tick in ticks])
    raw = interpolated(times, poses, np.array([tick.time_s for tick in ticks]))
    for after, before in zip(differences(shown, at_rest(shown)), differences(raw, at_rest(raw)), strict=True):
        assert after.std() < 0.55 * before.std()
        assert np.diff(after, 2, axis=0).std() < 0.12 * np.diff(before, 2, axis=0).std()


@pytest.mark.parametrize("look_ahead_s", [0.5, 0.25, 0.1, 0.0])
def test_the_calm_pose_is_at_every_look_ahead_nearer_to_the_truth(look_ahead_s: float) -> None:
    times = np.arange(720) / 120.0
    poses = shaken(hand_motion(times), NOISE_M, NOISE_RAD)
    ticks = [tick for tick in ticks_of(times, {"body": poses}, look_ahead_s) if tick.time_s > 2.0]
    shown, at = np.array([tick.bodies["body"].pose for tick in ticks]), np.array([tick.time_s for tick in ticks])
    for error, noise in zip(differences(shown, hand_motion(at)), (NOISE_M, NOISE_RAD), strict=True):
        assert np.sqrt((error**2).mean()) < (0.6 if look_ahead_s else 0.95) * noise


@pytest.mark.parametrize("look_ahead_s", [0.5, 0.2, 0.0])
@pytest.mark.parametrize("noise_m", [0.0, 0.8 * CLEAN_M])
def test_a_clean_stream_is_not_changed_by_a_bit(look_ahead_s: float, noise_m: float) -> None:
    times = np.arange(480) / 120.0
    poses, track = shaken(hand_motion(times), noise_m, noise_m), PoseBuffer()
    for t, pose in zip(times.tolist(), poses, strict=True):
        track.add(t, pose)
    for tick in ticks_of(times, {"body": poses}, look_ahead_s):
        known = tick.time_s + WINDOW_OFFSETS_S <= tick.time_s + look_ahead_s
        at = (tick.time_s + WINDOW_OFFSETS_S)[known]
        plain = sample([track], at, tick.time_s, tick.time_s + look_ahead_s, None)[0][0]
        np.testing.assert_array_equal(tick.bodies["body"].window[known], plain)


def test_a_slow_body_beside_a_noisy_one_moves_as_it_did() -> None:
    """All bodies get the same kernel, so what is held keeps its place in the hand."""
    times = np.arange(480) / 120.0
    hand = hand_motion(times)
    held = hand + np.array([0.0, 0.05, 0.1, 0.0, 0.0, 0.0, 0.0])
    noisy = shaken(at_rest(times), NOISE_M, NOISE_RAD)
    for tick in ticks_of(times, {"hand": hand, "held": held, "noisy": noisy}):
        apart = tick.bodies["held"].window[:, :3] - tick.bodies["hand"].window[:, :3]
        np.testing.assert_allclose(apart, np.tile([0.0, 0.05, 0.1], (21, 1)), atol=1e-9)


def test_an_impact_is_not_blurred() -> None:
    """A body that stops within a frame at 1 m/s is never shown further from the truth than a noisy pose may be."""
    times = np.arange(720) / 120.0
    stop_s = 4.0
    worst = []
    for seed in range(20):
        truth = at_rest(times)
        truth[:, 1] += np.minimum(times - stop_s, 0.0)
        poses = shaken(truth, NOISE_M, NOISE_RAD, seed)
        ticks = [tick for tick in ticks_of(times, {"body": poses}) if abs(tick.time_s - stop_s) < 0.15]
        height = np.array([tick.bodies["body"].pose[1] for tick in ticks])
        worst.append(np.abs(height - 1.0 - np.minimum([tick.time_s - stop_s for tick in ticks], 0.0)).max())
    assert max(worst) < 4.0 * NOISE_M


@pytest.mark.parametrize("change", [(0.5, 0.0), (0.0, 0.5)])
def test_a_look_ahead_that_changes_live_moves_nothing_suddenly(change: tuple[float, float]) -> None:
    times, steady = np.arange(960) / 120.0, []
    poses = shaken(at_rest(times), NOISE_M, NOISE_RAD)
    for seconds in change:
        shown = np.array([tick.bodies["body"].pose for tick in ticks_of(times, {"body": poses}, seconds)])
        steady.append(np.linalg.norm(np.diff(shown[120:, :3], axis=0), axis=1).max())
    timeline, shown = Timeline(change[0]), []
    for t, pose in zip(times.tolist(), poses, strict=True):
        if t == 3.0:
            timeline.look_ahead_s = change[1]
        timeline.push(t, {"body": pose}, t)
        while (tick := timeline.poll(t)) is not None:
            shown.append(tick.bodies["body"].pose)
    steps = np.linalg.norm(np.diff(np.array(shown)[120:, :3], axis=0), axis=1)
    assert steps.max() <= 1.5 * max(steady)


def test_a_gap_is_crossed_on_a_straight_line_between_calm_ends() -> None:
    times = np.arange(240) / 120.0
    times = times[(times < 0.9) | (times > 1.1)]
    poses = shaken(fall(times), NOISE_M, NOISE_RAD)
    ends = np.array([times[times < 1.0][-1], times[times > 1.0][0]])
    at = np.linspace(ends[0], ends[1], 9)
    out, start_end = smoothed(times, poses, at), smoothed(times, poses, ends)
    share = np.linspace(0.0, 1.0, 9)[:, None]
    np.testing.assert_allclose(out[:, :3], start_end[0, :3] + share * (start_end[1, :3] - start_end[0, :3]), atol=1e-12)
    shift, _ = differences(start_end, fall(ends))
    assert np.abs(shift).max() < 3 * NOISE_M


def test_lost_frames_leave_a_noisy_stream_calm() -> None:
    times = np.arange(720) / 90.0
    kept = np.random.default_rng(2).random(len(times)) > 0.1
    poses = shaken(hand_motion(times), NOISE_M, NOISE_RAD)
    timeline, ticks = Timeline(), []
    for t, pose, seen in zip(times.tolist(), poses, kept, strict=True):
        timeline.push(t, {"body": pose if seen else None}, t)
        while (tick := timeline.poll(t)) is not None:
            ticks.append(tick)
    ticks = [tick for tick in ticks if tick.time_s > 2.0]
    shown = np.array([tick.bodies["body"].pose for tick in ticks])
    shift, _ = differences(shown, hand_motion(np.array([tick.time_s for tick in ticks])))
    assert np.sqrt((shift**2).mean()) < 0.7 * NOISE_M


def test_the_forecast_of_a_noisy_stream_does_not_throw_it_about() -> None:
    times = np.arange(720) / 120.0
    poses = shaken(at_rest(times), NOISE_M, NOISE_RAD)
    ticks = [tick for tick in ticks_of(times, {"body": poses}, 0.1) if tick.time_s > 2.0]
    futures = np.array([tick.bodies["body"].window[-1, :3] for tick in ticks])
    assert (futures - [0.1, 1.0, -0.3]).std() < 3e-3
    assert np.array([tick.bodies["body"].window[PRESENT, :3] for tick in ticks]).std(axis=0).max() < 0.5 * NOISE_M


def test_smoothing_begins_and_ends_gradually() -> None:
    smoother, noisy = Smoother(), Noise(1e-3, 0.0, 1 / 120, SPAN_S)
    assert smoother.follow([UNKNOWN, UNKNOWN]) is None
    shares = [smoother.follow([UNKNOWN, noisy]) for _ in range(300)]
    shares += [smoother.follow([UNKNOWN]) for _ in range(300)]
    values = np.array([0.0 if one is None else one.share for one in shares])
    assert np.abs(np.diff(values)).max() <= 1.0 / FOLLOW_TICKS
    assert values[299] > 0.99
    assert shares[-1] is None


def test_a_noisy_body_that_is_gone_no_longer_counts() -> None:
    times = np.arange(960) / 120.0
    hand, noisy = hand_motion(times), shaken(at_rest(times), NOISE_M, NOISE_RAD)
    timeline, moved = Timeline(), []
    for t, pose, other in zip(times.tolist(), hand, noisy, strict=True):
        timeline.push(t, {"hand": pose, "noisy": other if t < 3.0 else None}, t)
        while (tick := timeline.poll(t)) is not None:
            moved.append(np.abs(tick.bodies["hand"].pose[:3] - hand_motion(np.array([tick.time_s]))[0, :3]).max())
    assert max(moved[120:180]) > 1e-5
    assert max(moved[-30:]) < 1e-6
