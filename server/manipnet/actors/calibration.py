"""Calibrates where a wrist frame sits on its tracked body, and how large the hands are.

The frame of a marker cluster on a wrist is arbitrary, and its motion alone does not tell where the wrist is in it.
Therefore both hands are shown in a known pose: flat on the sheet of `docs/calibration.md`, wrists on its two marks,
fingers together along its two lines. That gives the wrist frames in the world. Sheet frame: origin at the centre of the
sheet, +x to the operator's right, +y up out of the table, +z toward the operator. Pure functions, no I/O.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from manipnet.geometry import (
    Array,
    Side,
    compose,
    invert,
    mirror_poses,
    quat_conjugate,
    quat_exp,
    quat_log,
    quat_multiply,
    quat_normalize,
    quat_rotate,
    transform,
)

HAND_LENGTH_M: Final = 0.219
"""Length of the model's hand, from the middle of the wrist to the tip of the middle finger."""
WRIST_HEIGHT_M: Final = 0.025
"""Height of the middle of the model's wrist above the table on which the hand lies."""
MARK_M: Final = (0.12, 0.10)
"""Place of the wrists: this far to either side of the sheet's centre, and this far toward the operator."""
HAND_LENGTH_RANGE_M: Final = (0.12, 0.28)

MIN_SAMPLES: Final = 20
TRACKED_SHARE: Final = 0.7
OUTLIER_SHARE: Final = 0.2
MAX_SPREAD_M, MAX_SPREAD_RAD = 0.003, np.radians(2.0)
"""RMS about the mean."""
MAX_DRIFT_M, MAX_DRIFT_RAD = 0.003, np.radians(1.5)
"""From the first third of the samples to the last."""
GOOD_M, GOOD_RAD = 0.001, np.radians(0.5)
"""A calibration is good up to this spread and drift, and fair beyond."""
REACH_M: Final = 0.20
"""A cluster is at most this far from its wrist."""
SIDEWAYS_M: Final = 0.03
"""A fingertip may touch at most this far beside its line."""


class CalibrationError(ValueError):
    """The pose that was shown cannot be used; the text says what was wrong and what to do."""


@dataclass(frozen=True, slots=True, eq=False)
class Steady:
    """A body that was held still: its mean world `pose (7,)`, and how still it was."""

    pose: Array
    spread_m: float
    spread_rad: float
    drift_m: float
    drift_rad: float
    samples: int
    outliers: int

    @property
    def good(self) -> bool:
        """Whether a calibration from it is good, not only fair."""
        return max(self.spread_m, self.drift_m) <= GOOD_M and max(self.spread_rad, self.drift_rad) <= GOOD_RAD


def steady_pose(poses: Array, name: str, expected: float = MIN_SAMPLES) -> Steady:
    """Mean of the world poses `(n, 7)` of the body `name`, oldest first, without outliers.

    Raises `CalibrationError` if too few of the `expected` samples are there, if too many are outliers, and if the body
    moved.
    """
    least = max(MIN_SAMPLES, int(TRACKED_SHARE * expected))
    if len(poses) < least:
        raise CalibrationError(
            f"{name}: only {len(poses)} tracked samples in that time, and at least {least} are needed; "
            "make sure that it is tracked, and hold it still all the time"
        )
    mean, kept = _robust_mean(poses)
    outliers = len(poses) - int(kept.sum())
    if outliers > OUTLIER_SHARE * len(poses):
        raise CalibrationError(
            f"{name}: {outliers} of {len(poses)} samples are far from the others; it moved, or its markers flicker: "
            "hold still, and check its markers in the tracking software"
        )
    steady = Steady(mean, *_spread(poses[kept], mean), *_drift(poses[kept]), len(poses), outliers)
    wanders = steady.drift_m > max(MAX_DRIFT_M, steady.spread_m)
    if wanders or steady.drift_rad > max(MAX_DRIFT_RAD, steady.spread_rad):
        raise CalibrationError(
            f"{name} moved by {_figure(steady.drift_m, steady.drift_rad)} while it had to be still; at most "
            f"{_figure(MAX_DRIFT_M, MAX_DRIFT_RAD)} are allowed: lay the hand down and try again"
        )
    if steady.spread_m > MAX_SPREAD_M or steady.spread_rad > MAX_SPREAD_RAD:
        raise CalibrationError(
            f"{name} trembles by {_figure(steady.spread_m, steady.spread_rad)} (RMS); at most "
            f"{_figure(MAX_SPREAD_M, MAX_SPREAD_RAD)} are allowed: rest it on the table, and check the residual "
            "that the tracking software shows"
        )
    return steady


def mean_pose(poses: Array) -> Array:
    """Mean position and mean rotation of poses `(n, 7)`; the rotation is the nearest to all (Markley et al. 2007)."""
    quats = poses[:, 3:]
    _, vectors = np.linalg.eigh(quats.T @ quats)
    q = vectors[:, -1]
    return np.concatenate([poses[:, :3].mean(axis=0), q if q[3] >= 0.0 else -q])


def sheet_at(position: Array, yaw: float) -> Array:
    """`T_world_sheet (7,)` of a sheet at `position (3,)` in the world, turned by `yaw` radians about the vertical."""
    return np.concatenate([position, quat_exp(np.array([0.0, yaw, 0.0]))])


def sheet_under(T_world_object: Array, lowest_m: float) -> Array:
    """`T_world_sheet (7,)` of a sheet under the middle of an object, on a table at the height `lowest_m`.

    Its lines are along the x axis of the object. Raises `CalibrationError` if that axis is far from level.
    """
    x, y, z = quat_rotate(T_world_object[3:], np.array([1.0, 0.0, 0.0]))
    if abs(y) > 0.5:
        raise CalibrationError(
            "the x axis of the reference object points up or down; place the object with its x axis along the line"
        )
    return sheet_at(np.array([T_world_object[0], lowest_m, T_world_object[2]]), float(np.arctan2(-z, x)))


def wrist_on_sheet(side: Side, hand_scale: float = 1.0) -> Array:
    """`T_sheet_wrist (7,)` of a hand in the pose to show: flat, wrist on its mark, fingers away from the operator."""
    x, z = MARK_M
    # columns: the wrist's x axis (fingers) to -z, its y axis (thumb) to -x, its z axis (back of the hand) to +y
    right = np.array([x, WRIST_HEIGHT_M * hand_scale, z, -0.5, 0.5, 0.5, 0.5])
    return right if side == "right" else mirror_poses(right)


def calibrate_wrist(side: Side, cluster: Steady, T_world_sheet: Array, hand_scale: float) -> Array:
    """`T_cluster_wrist (7,)` of a hand that was shown on the sheet.

    Raises `CalibrationError` if the cluster is far from its mark.
    """
    T_sheet_cluster = compose(invert(T_world_sheet), cluster.pose)
    T_sheet_wrist = wrist_on_sheet(side, hand_scale)
    off_m = float(np.linalg.norm(T_sheet_cluster[:3] - T_sheet_wrist[:3]))
    if off_m > REACH_M:
        other: Side = "left" if side == "right" else "right"
        crossed = np.linalg.norm(T_sheet_cluster[:3] - wrist_on_sheet(other, hand_scale)[:3]) < REACH_M
        remedy = (
            f"it is at the {other} hand's mark: swap the two bodies in the rig, or the hands"
            if crossed
            else "check where the sheet lies and which body is which (`manipnet doctor`)"
        )
        raise CalibrationError(
            f"the body of {side}_wrist is {off_m:.2f} m from the {side} wrist's mark; "
            f"at most {REACH_M:.2f} m are allowed: {remedy}"
        )
    offset = compose(invert(T_sheet_cluster), T_sheet_wrist)
    return np.concatenate([offset[:3], quat_normalize(offset[3:])])


def scaled_offset(T_cluster_wrist: Array, scale_before: float, scale: float) -> Array:
    """The same offset for hands of another size, because the middle of a thicker wrist is higher."""
    higher = np.array([0.0, 0.0, WRIST_HEIGHT_M * (scale - scale_before), 0.0, 0.0, 0.0, 1.0])
    return compose(T_cluster_wrist, higher)


def measured_length(side: Side, T_world_wrist: Array, T_world_sheet: Array) -> float:
    """Length in metres of a hand whose middle fingertip touches the end of its line, at the sheet's centre line.

    `T_world_wrist (7,)` is the calibrated wrist. Raises `CalibrationError` for an impossible length or direction.
    """
    T_sheet_wrist = compose(invert(T_world_sheet), T_world_wrist)
    mark_x = MARK_M[0] if side == "right" else -MARK_M[0]
    toward = np.array([1.0, 0.0, 0.0]) if side == "right" else np.array([-1.0, 0.0, 0.0])
    fingers = quat_rotate(T_sheet_wrist[3:], toward)
    to_mark = np.array([mark_x, 0.0, 0.0]) - T_sheet_wrist[:3]
    flat = np.array([1.0, 0.0, 1.0])
    length = float(np.linalg.norm(to_mark * flat))
    heading = fingers * flat / max(float(np.linalg.norm(fingers * flat)), 1e-9)
    beside_m = float(np.linalg.norm(to_mark * flat - heading * (heading @ to_mark)))
    if not HAND_LENGTH_RANGE_M[0] <= length <= HAND_LENGTH_RANGE_M[1] or heading @ to_mark < 0.0:
        raise CalibrationError(
            f"the {side} wrist is {length:.3f} m from the mark that its middle finger should touch; allowed are "
            f"{HAND_LENGTH_RANGE_M[0]} … {HAND_LENGTH_RANGE_M[1]} m: touch the centre line with straight fingers"
        )
    if beside_m > SIDEWAYS_M:
        raise CalibrationError(
            f"the {side} middle finger points {100 * beside_m:.0f} cm beside its mark; at most "
            f"{100 * SIDEWAYS_M:.0f} cm are allowed: calibrate the wrists first, then touch the mark with a straight "
            "middle finger"
        )
    return length


def upright_on_sheet(T_world_sheet: Array, lowest_y_m: float) -> Array:
    """`T_world_object (7,)` of an object that stands on the centre of the sheet, its axes along the sheet's.

    Its mesh reaches down to `lowest_y_m` in its own frame.
    """
    return compose(T_world_sheet, np.array([0.0, -lowest_y_m, 0.0, 0.0, 0.0, 0.0, 1.0]))


def difference(T_a: Array, T_b: Array) -> tuple[float, float]:
    """Distance of two poses `(7,)` in metres and in radians."""
    turn = quat_log(quat_multiply(quat_conjugate(T_a[3:]), T_b[3:]))
    return float(np.linalg.norm(T_a[:3] - T_b[:3])), float(np.linalg.norm(turn))


def lowest_point(vertices: Array, T_world_object: Array) -> float:
    """Height in metres of the lowest of `vertices (V, 3)`, which are given in the object's frame."""
    return float(transform(T_world_object, vertices)[:, 1].min())


def _robust_mean(poses: Array) -> tuple[Array, np.ndarray]:
    """The mean of the samples that agree, and a mask `(n,)` of them."""
    middle = np.concatenate([np.median(poses[:, :3], axis=0), _middle_rotation(poses[:, 3:])])
    for _ in range(3):
        kept = np.ones(len(poses), dtype=bool)
        for error, floor in zip(_errors(poses, middle), (1e-3, np.radians(0.5)), strict=True):
            kept &= error <= max(5.0 * float(np.median(error)), floor)
        middle = mean_pose(poses[kept])
    return middle, kept


def _middle_rotation(quats: Array) -> Array:
    """Of up to 64 of the rotations, the one that is nearest to all."""
    some = quats[:: max(len(quats) // 64, 1)]
    return some[np.argmax(np.abs(some @ quats.T).sum(axis=1))]


def _errors(poses: Array, mean: Array) -> tuple[Array, Array]:
    turns = quat_log(quat_multiply(quat_conjugate(mean[3:]), poses[:, 3:]))
    return np.linalg.norm(poses[:, :3] - mean[:3], axis=1), np.linalg.norm(turns, axis=1)


def _spread(poses: Array, mean: Array) -> tuple[float, float]:
    away_m, away_rad = _errors(poses, mean)
    return float(np.sqrt(np.mean(away_m**2))), float(np.sqrt(np.mean(away_rad**2)))


def _drift(poses: Array) -> tuple[float, float]:
    third = len(poses) // 3
    return difference(mean_pose(poses[:third]), mean_pose(poses[-third:]))


def _figure(metres: float, radians: float) -> str:
    return f"{1e3 * metres:.1f} mm and {np.degrees(radians):.1f}°"
