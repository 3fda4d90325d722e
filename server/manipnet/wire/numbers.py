"""All numbers of a hands message in one array, so that they are checked and encoded together.

Their order is that of the msgpack encoding: three times, the hands, the bodies, and the latency.
"""

from collections.abc import Iterator
from dataclasses import fields
from functools import lru_cache
from math import prod
from typing import Final, NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.wire.hands import RECORDS, HandPose, HandsMessage, Latency

TIMES: Final = 3
"""`t_capture`, `t_publish` and `look_ahead`."""
SHIFT_SHAPE: Final = (3,)
POSE_SHAPE: Final = (7,)
HAND_SHAPES: Final = tuple((name, dtype.shape) for name, dtype in RECORDS[HandPose] if dtype.shape)
"""The arrays of a hand, without the shift of an avatar's wrist, in order; the hand's `scale` comes before them."""
_SIZES = tuple(prod(shape) for _, shape in HAND_SHAPES)
_STARTS = {name: 1 + sum(_SIZES[:place]) for place, (name, _) in enumerate(HAND_SHAPES)}
HAND_NUMBERS: Final = 1 + sum(_SIZES)
HAND_COLUMNS: Final = _STARTS["angles"], _STARTS["rotations"], _STARTS["wrist"], _STARTS["joints"]
"""Where each of these arrays begins among the numbers of a hand."""
LATENCIES: Final = tuple(field.name for field in fields(Latency))


def allocate_numbers(hands: int, bodies: int) -> Array:
    """Memory for the numbers of a message of the model's hands."""
    return np.empty(TIMES + hands * HAND_NUMBERS + bodies * POSE_SHAPE[0] + len(LATENCIES))


def hand_rows(numbers: Array, hands: int) -> Array:
    """The part of those numbers that is about the hands, `(hands, HAND_NUMBERS)`."""
    return numbers[TIMES : TIMES + hands * HAND_NUMBERS].reshape(hands, HAND_NUMBERS)


class HandArrays(NamedTuple):
    """The arrays of `HandPose` of any number of hands."""

    angles: Array
    rotations: Array
    wrist: Array
    joints: Array


def hand_arrays(rows: Array) -> HandArrays:
    """The arrays of hands in their numbers `(N, HAND_NUMBERS)`, without a copy."""
    return HandArrays(*[rows[:, columns].reshape(shape) for columns, shape in _PARTS])


_PARTS: Final = tuple(
    (slice(start, start + size), (-1, *shape))
    for (_, shape), start, size in zip(HAND_SHAPES, HAND_COLUMNS, _SIZES, strict=True)
)


def numbers_of(message: HandsMessage) -> Array | None:
    """The numbers of a message, `float64`; None if one of its arrays has a wrong shape."""
    latency = message.latency_ms
    parts: list[Array | tuple[float, ...]] = [(message.t_capture, message.t_publish, message.look_ahead)]
    for hand in message.hands.values():
        parts.append((hand.scale,))
        for name, shape in HAND_SHAPES:
            value = getattr(hand, name)
            if value.shape != shape:
                return None
            parts.append(value.ravel())
        if hand.wrist_shift is not None:
            if hand.wrist_shift.shape != SHIFT_SHAPE:
                return None
            parts.append(hand.wrist_shift)
    for body in message.bodies:
        if body.pose.shape != POSE_SHAPE:
            return None
        parts.append(body.pose)
    parts.append(tuple(getattr(latency, name) for name in LATENCIES))
    return np.concatenate(parts, dtype=np.float64)


def hand_starts(message: HandsMessage) -> Iterator[int]:
    """Where the numbers of each hand begin, and then those of the bodies."""
    start = TIMES
    for hand in message.hands.values():
        yield start
        start += HAND_NUMBERS + (0 if hand.wrist_shift is None else SHIFT_SHAPE[0])
    yield start


def quaternion_places(message: HandsMessage) -> np.ndarray:
    """Where the quaternions of a message are among its numbers, `(n, 4)`."""
    return _quaternion_places(tuple(hand_starts(message)), len(message.bodies))


@lru_cache(64)
def _quaternion_places(starts: tuple[int, ...], bodies: int) -> np.ndarray:
    *hands, first_body = starts
    places = [first_body + POSE_SHAPE[0] * body + 3 for body in range(bodies)]
    shapes = dict(HAND_SHAPES)
    for start in hands:
        places.append(start + _STARTS["wrist"] + 3)
        places += [start + _STARTS["rotations"] + 4 * bone for bone in range(shapes["rotations"][0])]
        places += [start + _STARTS["joints"] + 7 * joint + 3 for joint in range(shapes["joints"][0])]
    return np.array(places, np.intp).reshape(-1, 1) + np.arange(4)
