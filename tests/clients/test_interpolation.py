"""Shown hands are not rougher than the data, whatever the display rate, losses and jitter."""

import numpy as np
import pytest
from manipnet_client import Interpolator
from manipnet_client.spline import spline_weights
from simulated_display import RATE_HZ, frame, left_of, peak_acceleration, play, shown_at, source, turn_about_z


@pytest.mark.parametrize("display_hz", [90, 144])
@pytest.mark.parametrize("network", ["clean", "lossy"])
def test_never_rougher_than_the_data(display_hz, network):
    rng = np.random.default_rng(7)
    x = source(1200, rng)
    keep = rng.random(len(x)) >= (0.05 if network == "lossy" else 0.0)
    delays = rng.uniform(0.0, 0.020 if network == "lossy" else 0.0005, len(x))
    shown = play(x, display_hz, keep, delays)
    for values in ([h.joints[4, 0] for h in shown], [h.angles[3] for h in shown]):
        assert peak_acceleration(values, display_hz) < 1.2 * peak_acceleration(x, RATE_HZ)
    turns = [turn_about_z(h) for h in shown]
    assert peak_acceleration(turns, display_hz) < 1.2 * peak_acceleration(x, RATE_HZ)


def test_shows_the_chosen_instant():
    x = np.sin(np.arange(300) / RATE_HZ)
    shown = play(x, 90, np.ones(300, bool), np.zeros(300), delay_s=0.05)
    now = np.arange(1.0, 5.0, 1.0 / 90)
    np.testing.assert_allclose([h.joints[0, 0] for h in shown], np.sin(now - 0.05), atol=1e-4)


def test_weights_reproduce_straight_lines_even_across_losses():
    present = {3, 4, 7, 8, 9, 12}
    for position in np.linspace(3, 12, 50):
        weights = spline_weights(position, present)
        assert sum(weights.values()) == pytest.approx(1.0)
        assert sum(g * w for g, w in weights.items()) == pytest.approx(position)


def test_weights_bound_the_acceleration_by_the_data():
    x = np.random.default_rng(0).normal(size=60)  # white noise: the worst case
    at = np.arange(3, 55, 60 / 144)
    shown = [sum(x[g] * w for g, w in spline_weights(u, range(60)).items()) for u in at]
    assert peak_acceleration(shown, 144) <= peak_acceleration(x, 60)


def test_silence_holds_then_fades_and_recovers_without_a_jump():
    interpolator = Interpolator(0.05)
    for k in range(60):
        interpolator.push(frame(k, k / RATE_HZ, 0.1), k / RATE_HZ)
    held = shown_at(interpolator, 1.4)
    faded = shown_at(interpolator, 2.2)
    assert held.weight == 1.0
    assert left_of(held).wrist[0] == pytest.approx(0.1)
    assert faded.weight == 0.0
    for k in range(130, 190):
        interpolator.push(frame(k, k / RATE_HZ, 0.3), k / RATE_HZ)
    shown = [shown_at(interpolator, now) for now in np.arange(2.21, 3.4, 0.01)]
    steps = np.abs(np.diff([0.1] + [left_of(s).wrist[0] for s in shown]))
    assert steps.max() < 0.02
    assert left_of(shown[-1]).wrist[0] == pytest.approx(0.3)
    assert np.all(np.diff([s.weight for s in shown]) <= 0.01 / 0.5 + 1e-9)
    assert shown[-1].weight == 1.0


def test_old_frames_are_dropped_and_a_backlog_is_not_shown():
    interpolator = Interpolator(0.05)
    for k in range(30):
        assert interpolator.push(frame(k, k / RATE_HZ, 0.0), k / RATE_HZ)
    assert not interpolator.push(frame(29, 29 / RATE_HZ, 9.0), 0.6)
    assert not any([interpolator.push(frame(k, k / RATE_HZ, 9.0), 5.5) for k in range(30, 310)])
    assert interpolator.push(frame(330, 5.5, 1.0), 5.5)
    assert shown_at(interpolator, 5.6).hands.seq == 330
    assert interpolator.late == 281


def test_a_new_session_and_a_clock_set_back_start_afresh():
    interpolator = Interpolator(0.0)
    for k in range(30):
        interpolator.push(frame(k, 100 + k / RATE_HZ, 0.0), k / RATE_HZ)
    interpolator.sample(0.5)
    assert interpolator.push(frame(0, 5.0, 1.0, session="other"), 0.6)
    assert shown_at(interpolator, 1.0).hands.session == "other"
    assert interpolator.push(frame(1, 2.0, 1.0, session="other"), 1.1)  # the take begins again
    assert shown_at(interpolator, 1.2).hands.t_capture == 2.0


def test_a_clock_that_changed_for_good_is_accepted_after_half_a_second():
    interpolator = Interpolator(0.05)
    taken = [interpolator.push(frame(k, k / RATE_HZ, 0.0), k / RATE_HZ + (k > 30)) for k in range(120)]
    assert taken[:31] == [True] * 31
    assert taken[70:] == [True] * 50
