"""Hands on disk: `hand.npz`, one array or list of names per field of `Hand`, checked when it is read."""

from pathlib import Path
from typing import Any, Final

import numpy as np

from manipnet.synthesis.hand.hand import MAX_ANGLES, MAX_FINGERS, MAX_JOINTS, MAX_SENSORS, Hand, Sensors, Skin
from manipnet.synthesis.hand.validation import HandError, check_hand

HAND_FILE: Final = "hand.npz"
"""Name of the file in a bundle's folder."""
FORMAT: Final = 1

_SHAPES: Final = {
    "parents": "J",
    "offsets_m": "J 3",
    "rest_quats": "B 4",
    "angle_bones": "A",
    "axes": "A 3",
    "limits_rad": "A 2",
    "fingers": "F *",
    "capsules": "C 2",
    "radii_m": "C",
    "skin_vertices": "V 3",
    "skin_faces": "N 3",
    "skin_bones": "V K",
    "skin_weights": "V K",
    "bind_angles_rad": "A",
    "sensor_bones": "S 2",
    "sensor_weights": "S 2",
    "sensor_points": "S 2 3",
    "sensor_normals": "S 2 3",
    "grid_center_m": "3",
}
"""Shape of each array; equal letters are equal lengths."""
_INDICES: Final = {
    "parents": ("J", -1),
    "angle_bones": ("B", 1),
    "fingers": ("J", -1),
    "capsules": ("J", 0),
    "skin_faces": ("V", 0),
    "skin_bones": ("B", 0),
    "sensor_bones": ("B", 0),
}
"""Arrays of indices: what they index, and the smallest index allowed."""
_UNIT: Final = ("rest_quats", "axes", "sensor_normals")
_SUM_TO_ONE: Final = ("skin_weights", "sensor_weights")
_LARGEST: Final = {"J": MAX_JOINTS, "A": MAX_ANGLES, "F": MAX_FINGERS, "S": MAX_SENSORS}


def read_hand(path: Path) -> Hand:
    """Read a hand. Raises `HandError`, whose text names the file and the field."""
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as content:
            arrays = dict(content)
    except OSError as error:
        raise HandError(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # numpy, zipfile and zlib each raise their own for a damaged file
        raise HandError(f"{path}: is not an NPZ file of a hand ({error})") from None
    try:
        return _hand(arrays)
    except HandError as error:
        raise HandError(f"{path}: {error}") from None


def write_hand(hand: Hand, path: Path) -> None:
    """Write a hand so that `read_hand` returns an equal one. Raises `HandError` for one that cannot be used."""
    arrays = {
        "format": np.array(FORMAT),
        "name": np.array(hand.name),
        "joint_names": np.array(hand.joint_names),
        "parents": hand.parents.astype(np.int8),
        "offsets_m": hand.offsets,
        "rest_quats": hand.rest_quats,
        "angle_names": np.array(hand.angle_names),
        "angle_bones": hand.angle_bones.astype(np.uint8),
        "axes": hand.axes,
        "limits_rad": hand.limits,
        "fingers": _table(hand.fingers),
        "capsules": hand.capsules.astype(np.uint8),
        "radii_m": hand.radii,
        "skin_vertices": hand.skin.vertices.astype(np.float32),
        "skin_faces": hand.skin.faces.astype(np.uint16),
        "skin_bones": hand.skin.bones.astype(np.uint8),
        "skin_weights": hand.skin.weights.astype(np.float32),
        "bind_angles_rad": hand.skin.bind_angles,
        "sensor_bones": hand.sensors.bones.astype(np.uint8),
        "sensor_weights": hand.sensors.weights,
        "sensor_points": hand.sensors.points,
        "sensor_normals": hand.sensors.normals,
        "grid_center_m": hand.sensors.grid_center,
    }
    _hand(arrays)
    np.savez_compressed(path, allow_pickle=False, **arrays)


def _hand(arrays: dict[str, np.ndarray]) -> Hand:
    if not np.array_equal(arrays.get("format", 0), FORMAT):
        raise HandError(f"it is not a hand of format {FORMAT}")
    values = _numbers(arrays)
    names = {key: _names(arrays, key) for key in ("joint_names", "angle_names")}
    fingers = tuple(tuple(joint for joint in row if joint >= 0) for row in values["fingers"].tolist())
    hand = Hand(
        str(arrays.get("name", "")),
        names["joint_names"],
        values["parents"],
        values["offsets_m"],
        values["rest_quats"],
        names["angle_names"],
        values["angle_bones"],
        values["axes"],
        values["limits_rad"],
        fingers,
        values["capsules"],
        values["radii_m"],
        Skin(
            values["skin_vertices"],
            values["skin_faces"].astype(np.int32),
            values["skin_bones"],
            values["skin_weights"],
            values["bind_angles_rad"],
        ),
        Sensors(
            values["sensor_bones"],
            values["sensor_weights"],
            values["sensor_points"],
            values["sensor_normals"],
            values["grid_center_m"],
        ),
    )
    check_hand(hand)
    return hand


def _numbers(arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """The arrays as float64 or int64, read-only, with consistent shapes."""
    lengths: dict[str, int] = {}
    values = {}
    for key, shape in _SHAPES.items():
        if key not in arrays:
            raise HandError(f"{key} is missing")
        array, letters = arrays[key], shape.split()
        kind = "iu" if key in _INDICES else "fiu"
        if array.dtype.kind not in kind or array.ndim != len(letters):
            raise HandError(f"{key} is {array.dtype} of shape {array.shape}; expected are numbers ({shape})")
        for letter, length in zip(letters, array.shape, strict=True):
            expected = int(letter) if letter.isdecimal() else lengths.setdefault(letter, length)
            if letter != "*" and length != expected:
                raise HandError(f"{key} has the shape {array.shape}; expected is ({shape}) with {letter} = {expected}")
        values[key] = np.ascontiguousarray(array, np.int64 if key in _INDICES else np.float64)
    for letter, largest in _LARGEST.items():
        if lengths[letter] > largest:
            raise HandError(f"it has {letter} = {lengths[letter]}; at most {largest} are allowed")
    for key, array in values.items():
        _check_numbers(key, array, lengths)
        array.flags.writeable = False
    return values


def _check_numbers(key: str, array: np.ndarray, lengths: dict[str, int]) -> None:
    if not np.isfinite(array).all():
        raise HandError(f"{key} holds a number that is not finite")
    if key in _INDICES:
        letter, smallest = _INDICES[key]
        if array.size and not (smallest <= array.min() and array.max() < lengths[letter]):
            raise HandError(
                f"{key} holds {array.min()} … {array.max()}; allowed are {smallest} … {lengths[letter] - 1}"
            )
    if key in _UNIT and not np.allclose(np.linalg.norm(array, axis=-1), 1.0, atol=1e-3):
        raise HandError(f"{key} must have length 1")
    if key in _SUM_TO_ONE and not (array.min() >= 0.0 and np.allclose(array.sum(axis=1), 1.0, atol=1e-3)):
        raise HandError(f"{key} must be at least 0 and sum to 1 in each row")


def _names(arrays: dict[str, np.ndarray], key: str) -> tuple[str, ...]:
    names = arrays.get(key)
    if names is None or names.dtype.kind != "U" or names.ndim != 1 or len(set(names.tolist())) != len(names):
        raise HandError(f"{key} must be a list of distinct names")
    return tuple(names.tolist())


def _table(fingers: tuple[tuple[int, ...], ...]) -> np.ndarray:
    table = np.full((len(fingers), max(map(len, fingers))), -1, np.int8)
    for row, finger in zip(table, fingers, strict=True):
        row[: len(finger)] = finger
    return table
