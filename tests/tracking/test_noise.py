"""The noise of a body is told from its motion, for every kind of tracker."""

import numpy as np
import pytest
from noisy_tracking import fall, hand_motion, shaken

from manipnet.tracking.noise import SPAN_S, UNKNOWN, estimate_noise

TRACKERS = [(0.1, 0.05), (0.3, 0.1), (1.0, 0.5), (2.0, 1.0)]
"""Millimetres and degrees, from a studio's system to the trackers of a headset."""


@pytest.mark.parametrize("rate_hz", [60.0, 90.0, 120.0, 240.0])
@pytest.mark.parametrize(("mm", "degrees"), TRACKERS)
def test_the_noise_of_a_moving_body_is_found_within_a_fifth(mm: float, degrees: float, rate_hz: float) -> None:
    times = np.arange(int(SPAN_S * rate_hz)) / rate_hz
    noise = estimate_noise(times, shaken(hand_motion(times), 1e-3 * mm, np.radians(degrees)))
    assert noise.position_m == pytest.approx(1e-3 * mm, rel=0.2)
    assert noise.rotation_rad == pytest.approx(np.radians(degrees), rel=0.2)
    assert noise.interval_s == pytest.approx(1.0 / rate_hz)


@pytest.mark.parametrize("seed", range(5))
def test_lost_frames_and_uneven_times_do_not_disturb_the_estimate(seed: int) -> None:
    rng = np.random.default_rng(seed)
    times = np.arange(int(SPAN_S * 90.0)) / 90.0
    times += rng.uniform(-0.003, 0.003, len(times))
    times = times[rng.random(len(times)) > 0.1]
    noise = estimate_noise(times, shaken(hand_motion(times), 2e-3, np.radians(1.0), seed))
    assert noise.position_m == pytest.approx(2e-3, rel=0.2)
    assert noise.rotation_rad == pytest.approx(np.radians(1.0), rel=0.2)


def test_a_motion_without_noise_has_none() -> None:
    times = np.arange(480) / 120.0
    noise = estimate_noise(times, fall(times))
    assert max(noise.position_m, noise.rotation_rad) < 1e-9
    moving = estimate_noise(times, hand_motion(times))
    assert moving.position_m < 2e-5
    assert moving.rotation_rad < np.radians(0.005)


def test_flipped_signs_of_quaternions_in_a_buffer_are_no_noise() -> None:
    from manipnet.tracking.pose_buffer import PoseBuffer

    track = PoseBuffer()
    for i, pose in enumerate(hand_motion(np.arange(480) / 120.0)):
        track.add(i / 120.0, pose * np.where(np.arange(7) < 3, 1.0, (-1.0) ** i))
    assert track.noise.rotation_rad < np.radians(0.005)


def test_nothing_is_said_of_few_samples_or_slow_streams() -> None:
    short, slow = np.arange(20) / 120.0, np.arange(120) / 30.0
    assert estimate_noise(short, shaken(hand_motion(short), 1e-3, 0.01)) == UNKNOWN
    assert estimate_noise(slow, shaken(hand_motion(slow), 1e-3, 0.01)) == UNKNOWN
