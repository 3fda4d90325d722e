"""Checks a hands message, before it is sent and after it is received."""

from dataclasses import fields
from typing import Any, Final

import numpy as np

from manipnet.geometry import SIDES, Array, Side
from manipnet.wire.bodies import MAX_BODIES, MessageError
from manipnet.wire.hands import STATES, VERSION, HandPose, HandsMessage, Latency
from manipnet.wire.numbers import HAND_SHAPES, POSE_SHAPE, SHIFT_SHAPE, numbers_of, quaternion_places
from manipnet.wire.timecode import MAX_RATE, is_rate, is_timecode

MAX_NUMBER: Final = 1e12
UNIT_TOLERANCE: Final = 1e-3
"""By how much the squared length of a quaternion may differ from 1."""
_SIDES = frozenset(SIDES)


def check(message: HandsMessage) -> Array:
    """Raise `MessageError` unless numbers are finite, shapes right, quaternions of unit length, and words known.

    Returns the message's numbers, as `numbers_of` does.
    """
    require_version(message.v)
    if not 0 <= message.seq < 2**64:
        raise MessageError(f"seq is {message.seq}; it must be 0 … 2^64 - 1")
    if len(message.bodies) > MAX_BODIES:
        raise MessageError(f"bodies has {len(message.bodies)} entries; at most {MAX_BODIES} are allowed")
    if message.timecode is not None and not is_timecode(message.timecode):
        raise MessageError(f"timecode is {message.timecode!r:.40}; it must be HH:MM:SS:FF or HH:MM:SS;FF")
    if message.timecode_rate is not None and not is_rate(message.timecode_rate):
        raise MessageError(f"timecode_rate is {message.timecode_rate}; it must be above 0 and at most {MAX_RATE:g}")
    numbers = message.numbers
    has_known_words = _has_known_words(message)
    if numbers is None or not has_known_words:
        numbers = numbers_of(message)
        if numbers is None or not has_known_words or not _are_sound(message, numbers):
            _check_numbers(message)
    assert numbers is not None  # a wrong shape has raised
    return numbers


def _has_known_words(message: HandsMessage) -> bool:
    """Whether sides and states are known, and hands have a size."""
    return all(side in _SIDES and hand.state in STATES and hand.scale > 0.0 for side, hand in message.hands.items())


def _are_sound(message: HandsMessage, numbers: Array) -> bool:
    """Whether all numbers and quaternions are in order; they are checked together, in a fraction of the time.

    False as well where only `_check_numbers` can tell.
    """
    # No square is larger than the sum of all. NaN fails every comparison.
    if not numbers @ numbers <= MAX_NUMBER**2:
        return False
    quats = numbers[quaternion_places(message)]
    excess = np.einsum("ij,ij->i", quats, quats) - 1.0
    return bool(excess @ excess <= UNIT_TOLERANCE**2)


def _check_numbers(message: HandsMessage) -> None:
    """Raise `MessageError`, which names the first number that is wrong, if any is."""
    numbers = (message.t_capture, message.t_publish, message.look_ahead)
    _check_floats(np.array(numbers), (3,), "t_capture, t_publish, look_ahead")
    latency = [getattr(message.latency_ms, f.name) for f in fields(Latency)]
    _check_floats(np.array(latency), (len(latency),), "latency_ms")
    for side, hand in message.hands.items():
        _check_hand(hand, f"hands.{known_side(side)}")
    for i, body in enumerate(message.bodies):
        _check_floats(body.pose, POSE_SHAPE, f"bodies[{i}]")
        _check_units(body.pose[3:], f"bodies[{i}].q")


def _check_hand(hand: HandPose, where: str) -> None:
    if hand.state not in STATES:
        raise MessageError(f"{where}.state is {hand.state!r}; allowed are {', '.join(STATES)}")
    if not (np.isfinite(hand.scale) and hand.scale > 0.0):
        raise MessageError(f"{where}.scale is {hand.scale}; it must be finite and above 0")
    for name, shape in HAND_SHAPES:
        _check_floats(getattr(hand, name), shape, f"{where}.{name}")
    if hand.wrist_shift is not None:
        _check_floats(hand.wrist_shift, SHIFT_SHAPE, f"{where}.wrist_shift")
    _check_units(hand.rotations, f"{where}.rotations")
    _check_units(hand.joints[:, 3:], f"{where}.joints")
    _check_units(hand.wrist[3:], f"{where}.wrist.q")


def _check_floats(value: Array, shape: tuple[int, ...], where: str) -> None:
    if value.shape != shape:
        raise MessageError(f"{where} has the shape {value.shape}; it must be {shape}")
    if not (np.abs(value) <= MAX_NUMBER).all():  # false for NaN too
        raise MessageError(f"{where} contains a number that is not finite or is beyond {MAX_NUMBER:g}")


def _check_units(quats: Array, where: str) -> None:
    lengths = np.einsum("...i,...i->...", quats, quats)
    if np.abs(lengths - 1.0).max() > UNIT_TOLERANCE:
        raise MessageError(f"{where} contains a quaternion that is not of unit length")


def require_version(version: Any) -> None:
    """Raise `MessageError`, which names both versions, for any other version."""
    if version != VERSION or isinstance(version, bool):
        raise MessageError(f"message is of version {version!r}; this reader understands version {VERSION}")


def known_side(side: Any) -> Side:
    """The side, if it is one. Raises `MessageError` otherwise."""
    if side not in SIDES:
        raise MessageError(f"hands has the key {side!r}; allowed are {', '.join(SIDES)}")
    return side
