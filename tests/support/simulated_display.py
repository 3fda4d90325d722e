"""A display that shows hands from a network which loses and delays frames, and a measure of how rough they look."""

from collections.abc import Sequence

import numpy as np
from manipnet_client import Hand, Hands, Interpolator, Shown, decode
from publisher import message

from manipnet.wire import encode_binary

RATE_HZ = 60


def frame(seq: int, t_capture: float, x_m: float, session: str = "s") -> Hands:
    """A frame as a client decodes it, with both hands at `x_m`."""
    return decode(encode_binary(message(seq, t_capture, x_m, session)))


def shown_at(interpolator: Interpolator, now_s: float) -> Shown:
    """What the interpolator shows; it must have received a frame."""
    shown = interpolator.sample(now_s)
    assert shown is not None
    return shown


def left_of(shown: Shown) -> Hand:
    """The left hand of a shown frame."""
    assert shown.hands.left is not None
    return shown.hands.left


def source(count: int, rng: np.random.Generator) -> np.ndarray:
    """Positions `(count,)` in metres at 60 Hz of a hand that makes quick, smooth strokes with some tremor."""
    t = np.arange(count) / RATE_HZ
    strokes = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in ((0.2, 0.4, 0), (0.05, 1.7, 1), (0.01, 4, 2)))
    return strokes + rng.normal(scale=0.0003, size=count)


def play(x: np.ndarray, display_hz: float, kept: np.ndarray, delays_s: np.ndarray, delay_s: float = 0.1) -> list[Hand]:
    """The left hands that a display shows of the positions `x (N,)`, sent at 60 Hz.

    The network delivers the frames that are `kept (N,)`, each after `delays_s (N,)`; the client shows them `delay_s`
    late.
    """
    interpolator = Interpolator(delay_s)
    order = sorted((k for k in range(len(x)) if kept[k]), key=lambda k: k / RATE_HZ + delays_s[k])
    arrivals = iter([(k / RATE_HZ + delays_s[k], frame(k, k / RATE_HZ, x[k])) for k in order])
    shown, upcoming = [], next(arrivals)
    for now_s in np.arange(1.0, len(x) / RATE_HZ, 1.0 / display_hz):
        while upcoming and upcoming[0] <= now_s:
            interpolator.push(upcoming[1], upcoming[0])
            upcoming = next(arrivals, None)
        shown.append(left_of(shown_at(interpolator, now_s)))
    return shown


def peak_acceleration(values: Sequence[float] | np.ndarray, rate_hz: float) -> float:
    """The largest second difference of values sampled at `rate_hz`, per square second."""
    return float(np.abs(np.diff(values, 2)).max() * rate_hz**2)


def turn_about_z(hand: Hand) -> float:
    """The angle of the wrist about z, radians."""
    return float(2 * np.arctan2(hand.wrist[5], hand.wrist[6]))
