"""Takes as other tracking systems would have streamed them."""

from dataclasses import replace

import numpy as np
import pytest
from noisy_tracking import at_rest, differences, hand_motion

from manipnet_tools.takes.rollout import tick_take
from manipnet_tools.takes.take import BodyTrack, Take, read_take
from manipnet_tools.takes.tracker import STEADY_S, Tracker, tracked_by

VR = Tracker(2e-3, np.radians(1.0), rate_hz=90.0, jitter_s=1e-3, losses=0.005)


def take_of(seconds: float, motion=hand_motion) -> Take:
    time_s = np.arange(int(120 * seconds)) / 120.0
    names = ("left_wrist", "right_wrist", "box")
    track = BodyTrack(motion(time_s), np.ones(len(time_s), np.bool_))
    return Take("take", 120.0, time_s, dict.fromkeys(names, track))


def test_without_faults_a_take_stays_as_it_is() -> None:
    take = take_of(2.0)
    same = tracked_by(Tracker(), take)
    np.testing.assert_array_equal(same.time_s, take.time_s)
    np.testing.assert_allclose(same.bodies["box"].poses, take.bodies["box"].poses, atol=1e-15)


def test_the_noise_is_as_large_as_requested_and_differs_between_bodies() -> None:
    seen = tracked_by(Tracker(1e-3, np.radians(0.5)), take_of(30.0, at_rest))
    for track in seen.bodies.values():
        shift, turn = differences(track.poses, at_rest(seen.time_s))
        assert shift.std() == pytest.approx(1e-3, rel=0.03)
        assert turn.std() == pytest.approx(np.radians(0.5), rel=0.03)
    assert not np.allclose(seen.bodies["left_wrist"].poses, seen.bodies["box"].poses)


def test_the_same_seed_gives_the_same_take() -> None:
    one, same, other = (tracked_by(VR, take_of(2.0), seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.bodies["box"].poses, same.bodies["box"].poses)
    np.testing.assert_array_equal(one.bodies["box"].tracked, same.bodies["box"].tracked)
    assert not np.allclose(one.bodies["box"].poses, other.bodies["box"].poses)


def test_another_rate_follows_the_motion() -> None:
    seen = tracked_by(Tracker(rate_hz=90.0), take_of(5.0))
    assert seen.rate_hz == 90.0
    np.testing.assert_allclose(np.diff(seen.time_s), 1 / 90)
    shift, turn = differences(seen.bodies["box"].poses, hand_motion(seen.time_s))
    assert max(np.abs(shift).max(), np.abs(turn).max()) < 5e-4


def test_bodies_are_lost_now_and_then_but_not_at_the_start() -> None:
    seen = tracked_by(VR, take_of(60.0))
    assert (np.diff(seen.time_s) > 0.0).all()
    for track in seen.bodies.values():
        assert 0.005 < 1.0 - track.tracked.mean() < 0.04
        assert track.tracked[: int(STEADY_S * 90)].all()


@pytest.mark.parametrize("tracker", [Tracker(1e-3, np.radians(0.5)), VR])
def test_the_noise_of_a_tracker_is_taken_out_of_a_captured_take(manipnet_data, tracker: Tracker) -> None:
    take = read_take(manipnet_data / "BVH" / "mug1")
    short = slice(0, 1200)
    bodies = {name: BodyTrack(track.poses[short], track.tracked[short]) for name, track in take.bodies.items()}
    take = replace(take, time_s=take.time_s[short], bodies=bodies, fingers={})
    clean, noisy = tick_take(take), tick_take(tracked_by(tracker, take))
    count = min(len(clean.time_s), len(noisy.time_s))
    for name, body in noisy.bodies.items():
        shift, turn = differences(body.poses[:count], clean.bodies[name].poses[:count])
        assert np.sqrt((shift**2).mean()) < 0.55 * tracker.position_m
        assert np.sqrt((turn**2).mean()) < 0.65 * tracker.rotation_rad
        tremor = [np.abs(np.diff(of.bodies[name].poses[:count, :3], 2, axis=0)).mean() for of in (noisy, clean)]
        assert tremor[0] - tremor[1] < 0.3 * tracker.position_m  # as it comes, it is twice the noise


@pytest.mark.parametrize("rate_hz", [120.0, 60.0])
@pytest.mark.parametrize("name", ["cup1", "mug1"])
def test_captured_takes_are_clean(manipnet_data, name: str, rate_hz: float) -> None:
    """Golden outputs and evaluations of captured takes are those without smoothing."""
    take = tracked_by(Tracker(rate_hz=rate_hz), read_take(manipnet_data / "BVH" / name))
    ticks = tick_take(take, 0.1)
    at = np.searchsorted(take.time_s, ticks.time_s - 1e-6)
    for body, track in take.bodies.items():
        shift, turn = differences(ticks.bodies[body].poses, track.poses[at])
        assert max(np.abs(shift).max(), np.abs(turn).max()) < 1e-7
