"""Checks a hands message, before it is sent and after it is received."""

from dataclasses import fields
from typing import Any, Final

import numpy as np

from manipnet.geometry import SIDES, Array, Side
from manipnet.wire.bodies import MAX_BODIES, MessageError
from manipnet.wire.hands import (
    RECORDS,
    STATES,
    VERSION,
    HandPose,
    HandsMessage,
    Latency,
)
from manipnet.wire.timecode import MAX_RATE, is_rate, is_timecode

MAX_NUMBER: Final = 1e12
UNIT_TOLERANCE: Final = 1e-3
"""By how much the squared length of a quaternion may differ from 1."""
_SHAPES = tuple((name, dtype.shape) for name, dtype in RECORDS[HandPose] if dtype.shape)


def check(message: HandsMessage) -> None:
    """Raise `MessageError` unless numbers are finite, shapes right, quaternions of unit length, and words known."""
    require_version(message.v)
    if not 0 <= message.seq < 2**64:
        raise MessageError(f"seq is {message.seq}; it must be 0 … 2^64 - 1")
    if len(message.bodies) > MAX_BODIES:
        raise MessageError(f"bodies has {len(message.bodies)} entries; at most {MAX_BODIES} are allowed")
    if message.timecode is not None and not is_timecode(message.timecode):
        raise MessageError(f"timecode is {message.timecode!r:.40}; it must be HH:MM:SS:FF or HH:MM:SS;FF")
    if message.timecode_rate is not None and not is_rate(message.timecode_rate):
        raise MessageError(f"timecode_rate is {message.timecode_rate}; it must be above 0 and at most {MAX_RATE:g}")
    if not _is_sound(message):
        _check_numbers(message)


def _is_sound(message: HandsMessage) -> bool:
    """Whether all numbers and quaternions are in order; they are checked together, in a fifth of the time.

    False as well where only `_check_numbers` can tell.
    """
    hands, poses, latency = message.hands.values(), [body.pose for body in message.bodies], message.latency_ms
    if not message.hands.keys() <= set(SIDES) or any(hand.state not in STATES for hand in hands):
        return False
    arrays = [(getattr(hand, name), shape) for hand in hands for name, shape in _SHAPES]
    arrays += [(hand.wrist_shift, (3,)) for hand in hands if hand.wrist_shift is not None]
    arrays += [(pose, (7,)) for pose in poses]
    if any(value.shape != shape for value, shape in arrays):
        return False
    scalars = (message.t_capture, message.t_publish, message.look_ahead, latency.buffer, latency.sense, latency.infer)
    scalars += (latency.ik, latency.total, *(hand.scale for hand in hands))
    numbers = np.concatenate([scalars, *(value.ravel() for value, _ in arrays)])
    placed = [*poses, *(hand.wrist for hand in hands)]
    quats = [np.reshape(placed, (-1, 7))[:, 3:], *(hand.rotations for hand in hands)]
    lengths = np.square(np.concatenate([*quats, *(hand.joints[:, 3:] for hand in hands)])).sum(axis=1)
    sound = (np.abs(numbers) <= MAX_NUMBER).all() and (np.abs(lengths - 1.0) <= UNIT_TOLERANCE).all()
    return bool(sound) and all(hand.scale > 0.0 for hand in hands)


def _check_numbers(message: HandsMessage) -> None:
    """Raise `MessageError`, which names the first number that is wrong, if any is."""
    numbers = (message.t_capture, message.t_publish, message.look_ahead)
    _check_floats(np.array(numbers), (3,), "t_capture, t_publish, look_ahead")
    latency = [getattr(message.latency_ms, f.name) for f in fields(Latency)]
    _check_floats(np.array(latency), (len(latency),), "latency_ms")
    for side, hand in message.hands.items():
        _check_hand(hand, f"hands.{known_side(side)}")
    for i, body in enumerate(message.bodies):
        _check_floats(body.pose, (7,), f"bodies[{i}]")
        _check_units(body.pose[3:], f"bodies[{i}].q")


def _check_hand(hand: HandPose, where: str) -> None:
    if hand.state not in STATES:
        raise MessageError(f"{where}.state is {hand.state!r}; allowed are {', '.join(STATES)}")
    if not (np.isfinite(hand.scale) and hand.scale > 0.0):
        raise MessageError(f"{where}.scale is {hand.scale}; it must be finite and above 0")
    for name, shape in _SHAPES:
        _check_floats(getattr(hand, name), shape, f"{where}.{name}")
    if hand.wrist_shift is not None:
        _check_floats(hand.wrist_shift, (3,), f"{where}.wrist_shift")
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
