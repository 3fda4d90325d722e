"""What is shown between frames: no rougher than the data, whatever the display rate, losses and jitter."""

import numpy as np
import pytest
from manipnet_client import Interpolator, decode
from manipnet_client.spline import spline_weights
from publisher import message

from manipnet.wire import encode_binary

RATE_HZ = 60


def frame(seq, t_capture, x, session="s"):
    return decode(encode_binary(message(seq, t_capture, x, session)))


def source(count, rng):
    """A hand that hurries about: smooth strokes with tremor on top, metres at 60 Hz."""
    t = np.arange(count) / RATE_HZ
    strokes = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in ((0.2, 0.4, 0), (0.05, 1.7, 1), (0.01, 4, 2)))
    return strokes + rng.normal(scale=0.0003, size=count)


def play(x, display_hz, keep, delays, delay_s=0.1):
    """What a display shows of `x`, sent at 60 Hz over a network that loses and delays frames."""
    interpolator = Interpolator(delay_s)
    order = sorted((k for k in range(len(x)) if keep[k]), key=lambda k: k / RATE_HZ + delays[k])
    arrivals = iter([(k / RATE_HZ + delays[k], frame(k, k / RATE_HZ, x[k])) for k in order])
    shown, upcoming = [], next(arrivals)
    for now in np.arange(1.0, len(x) / RATE_HZ, 1.0 / display_hz):
        while upcoming and upcoming[0] <= now:
            interpolator.push(upcoming[1], upcoming[0])
            upcoming = next(arrivals, None)
        shown.append(interpolator.sample(now).hands.left)
    return shown


def roughest(values, rate_hz):
    return np.abs(np.diff(values, 2)).max() * rate_hz**2


@pytest.mark.parametrize("display_hz", [90, 144])
@pytest.mark.parametrize("network", ["clean", "lossy"])
def test_never_rougher_than_the_data(display_hz, network):
    rng = np.random.default_rng(7)
    x = source(1200, rng)
    keep = rng.random(len(x)) >= (0.05 if network == "lossy" else 0.0)
    delays = rng.uniform(0.0, 0.020 if network == "lossy" else 0.0005, len(x))
    shown = play(x, display_hz, keep, delays)
    for values in ([h.joints[4, 0] for h in shown], [h.angles[3] for h in shown]):
        assert roughest(values, display_hz) < 1.2 * roughest(x, RATE_HZ)
    turns = [2 * np.arctan2(h.wrist[5], h.wrist[6]) for h in shown]
    assert roughest(turns, display_hz) < 1.2 * roughest(x, RATE_HZ)


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
    assert roughest(shown, 144) <= roughest(x, 60)


def test_silence_holds_then_fades_and_recovers_without_a_jump():
    interpolator = Interpolator(0.05)
    for k in range(60):
        interpolator.push(frame(k, k / RATE_HZ, 0.1), k / RATE_HZ)
    held = interpolator.sample(1.4)
    faded = interpolator.sample(2.2)
    assert held.weight == 1.0
    assert held.hands.left.wrist[0] == pytest.approx(0.1)
    assert faded.weight == 0.0
    for k in range(130, 190):
        interpolator.push(frame(k, k / RATE_HZ, 0.3), k / RATE_HZ)
    shown = [interpolator.sample(now) for now in np.arange(2.21, 3.4, 0.01)]
    steps = np.abs(np.diff([0.1] + [s.hands.left.wrist[0] for s in shown]))
    assert steps.max() < 0.02
    assert shown[-1].hands.left.wrist[0] == pytest.approx(0.3)
    assert np.all(np.diff([s.weight for s in shown]) <= 0.01 / 0.5 + 1e-9)
    assert shown[-1].weight == 1.0


def test_old_frames_are_dropped_and_a_backlog_is_not_shown():
    interpolator = Interpolator(0.05)
    for k in range(30):
        assert interpolator.push(frame(k, k / RATE_HZ, 0.0), k / RATE_HZ)
    assert not interpolator.push(frame(29, 29 / RATE_HZ, 9.0), 0.6)
    assert not any([interpolator.push(frame(k, k / RATE_HZ, 9.0), 5.5) for k in range(30, 310)])
    assert interpolator.push(frame(330, 5.5, 1.0), 5.5)
    assert interpolator.sample(5.6).hands.seq == 330
    assert interpolator.late == 281


def test_a_new_session_and_a_clock_set_back_start_afresh():
    interpolator = Interpolator(0.0)
    for k in range(30):
        interpolator.push(frame(k, 100 + k / RATE_HZ, 0.0), k / RATE_HZ)
    interpolator.sample(0.5)
    assert interpolator.push(frame(0, 5.0, 1.0, session="other"), 0.6)
    assert interpolator.sample(1.0).hands.session == "other"
    assert interpolator.push(frame(1, 2.0, 1.0, session="other"), 1.1)  # the take begins again
    assert interpolator.sample(1.2).hands.t_capture == 2.0


def test_a_clock_that_changed_for_good_is_accepted_after_half_a_second():
    interpolator = Interpolator(0.05)
    taken = [interpolator.push(frame(k, k / RATE_HZ, 0.0), k / RATE_HZ + (k > 30)) for k in range(120)]
    assert taken[:31] == [True] * 31
    assert taken[70:] == [True] * 50
