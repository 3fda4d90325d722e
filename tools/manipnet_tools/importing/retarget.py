"""Fits the model's hand to the joints of another: the wrist to the palm, then all angles by least squares.

The palm is rigid in the model's hand, so its pose follows from the wrist and the knuckles alone (Kabsch 1976). The
angles minimise the distances to all joints of a frame, fingertips counting most, inside the limits of the hand, by
damped Gauss-Newton steps on all frames at once. Hands of other people are a little larger or smaller; what the angles
cannot reach for that reason remains as an error, which is reported.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from manipnet.geometry import Array, Side, matrix_to_quat, mirror_points, mirror_poses
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet_tools.importing.source import FINGERS, JOINT_COUNT, PALM, ImportingError

STEPS: Final = 40
SETTLED_RAD: Final = 1e-4
DAMPING: Final = 1e-6
"""Square metres, added to the normal equations: a hinge that moves no joint stays where it is."""
DIFFERENCE_RAD: Final = 1e-4
LARGEST_ERROR_M: Final = 0.015
"""Joints whose median error is larger are not those of a hand, or in another order."""
LENGTH_CHANGE: Final = 0.2
"""Bones that change their lengths by more than this are not those of a hand."""
START_RAD: Final = 0.2
_FRAMES_AT_ONCE: Final = 2000
_PALM_WEIGHTS: Final = np.array([0.5, 1.0, 1.0, 1.0, 1.0])
_WEIGHTS: Final = np.array([0.0, 0.3, 0.7, 1.0, 1.5, *4 * (0.7, 1.0, 1.0, 1.5)])
_MEASURED: Final = np.arange(2, JOINT_COUNT)
"""The joints whose errors count: where the thumb begins differs from convention to convention."""


@dataclass(frozen=True, eq=False)
class Fit:
    """The model's hand in T frames."""

    wrist: Array
    """`(T, 7)` in the world; a left hand's is mirrored as everywhere."""
    angles: Array
    """`(T, A)` radians, inside the limits."""
    error_m: Array
    """`(T,)` mean distance between the joints of both hands; NaN in a frame without joints."""


def model_joints(hand: Hand) -> list[int]:
    """The model's joint for each of the 21; the thumb's first one is where its last CMC hinge is."""
    chains = [finger[-4:] for finger in hand.fingers]
    if len(chains) != len(FINGERS) or any(len(chain) != 4 for chain in chains):
        raise ImportingError(
            f"the hand {hand.name} has {len(chains)} fingers; takes can be fitted to one with five only"
        )
    return [0, *(joint for chain in chains for joint in chain)]


def fit_hand(joints: Array, side: Side, hand: Hand) -> Fit:
    """Fit `hand` to the joints `(T, 21, 3)` of a hand, metres. A frame without the palm has NaN poses and angles.

    Raises `ImportingError` for joints that are not those of a hand.
    """
    points = joints if side == "right" else mirror_points(joints)
    seen = np.isfinite(points[:, PALM]).all(axis=(1, 2))
    if not seen.any():
        raise ImportingError(f"the {side} hand has no frame with its wrist and knuckles")
    _check_lengths(points[seen], side)
    wrist = np.full((len(points), 7), np.nan)
    angles = np.full((len(points), hand.angle_count), np.nan)
    error_m = np.full(len(points), np.nan)
    frames = np.flatnonzero(seen)
    for start in range(0, len(frames), _FRAMES_AT_ONCE):
        part = frames[start : start + _FRAMES_AT_ONCE]
        rotations, translations = _palm_pose(points[part], hand)
        local = np.einsum("tji,tkj->tki", rotations, points[part] - translations[:, None])
        angles[part], error_m[part] = _fit_angles(local, hand)
        wrist[part] = np.concatenate([translations, matrix_to_quat(rotations)], axis=1)
    median_m = float(np.nanmedian(error_m))
    if median_m > LARGEST_ERROR_M:
        raise ImportingError(
            f"the {side} hand does not fit: its joints are {1e3 * median_m:.0f} mm from those of a hand (allowed are "
            f"{1e3 * LARGEST_ERROR_M:.0f} mm at the median); check their order, their unit, and left and right"
        )
    return Fit(wrist if side == "right" else mirror_poses(wrist), angles, error_m)


def _check_lengths(points: Array, side: Side) -> None:
    """Raise `ImportingError` if the bones of a hand change their lengths."""
    for f, finger in enumerate(FINGERS):
        for bone in range(2 + 4 * f, 5 + 4 * f):
            lengths = np.linalg.norm(points[:, bone] - points[:, bone - 1], axis=1)
            lengths = lengths[np.isfinite(lengths)]
            if not len(lengths):
                continue
            low, middle, high = np.percentile(lengths, [5, 50, 95])
            if high - low > LENGTH_CHANGE * max(middle, 1e-9):
                raise ImportingError(
                    f"bone {bone - 1 - 4 * f} of the {side} {finger} is {1e3 * low:.0f} to {1e3 * high:.0f} mm long: "
                    "these are not the joints of a hand, or not in the order that the documentation gives"
                )


def _palm_pose(points: Array, hand: Hand) -> tuple[Array, Array]:
    """Rotations `(T, 3, 3)` and translations `(T, 3)` of the wrist that put the model's palm onto the points."""
    model = forward_kinematics(hand, np.zeros(hand.angle_count))[0][model_joints(hand)][list(PALM)]
    shares = _PALM_WEIGHTS / _PALM_WEIGHTS.sum()
    palm = points[:, PALM]
    centre, model_centre = np.einsum("k,tki->ti", shares, palm), shares @ model
    covariance = np.einsum("k,tki,kj->tij", shares, palm - centre[:, None], model - model_centre)
    u, _, vt = np.linalg.svd(covariance)
    u[..., 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    rotations = u @ vt
    return rotations, centre - np.einsum("tij,j->ti", rotations, model_centre)


def _fit_angles(local: Array, hand: Hand) -> tuple[Array, Array]:
    """Angles `(T, A)` and errors `(T,)` for joints `(T, 21, 3)` in the wrist's frame."""
    joints = model_joints(hand)
    weights = np.where(np.isfinite(local).all(axis=2), _WEIGHTS, 0.0)
    targets = np.nan_to_num(local)
    lower, upper = hand.limits.T
    angles = np.tile(np.clip(np.full(hand.angle_count, START_RAD), lower, upper), (len(local), 1))
    damping = DAMPING * np.eye(hand.angle_count)
    for _ in range(STEPS):
        positions = forward_kinematics(hand, angles)[0][:, joints]
        residuals = (weights[..., None] * (targets - positions)).reshape(len(local), -1)
        jacobian = _jacobian(angles, positions, hand, joints, weights)
        gradient = np.einsum("tra,tr->ta", jacobian, residuals)
        held = ((angles <= lower) & (gradient < 0.0)) | ((angles >= upper) & (gradient > 0.0))
        jacobian = np.where(held[:, None], 0.0, jacobian)
        normal = np.einsum("tra,trb->tab", jacobian, jacobian) + damping
        step = np.linalg.solve(normal, np.where(held, 0.0, gradient)[..., None])[..., 0]
        moved = np.clip(angles + np.clip(step, -0.5, 0.5), lower, upper)
        largest, angles = float(np.abs(moved - angles).max()), moved
        if largest < SETTLED_RAD:
            break
    positions = forward_kinematics(hand, angles)[0][:, joints]
    distances = np.linalg.norm(local - positions, axis=2)[:, _MEASURED]
    return angles, np.nanmean(distances, axis=1)


def _jacobian(angles: Array, positions: Array, hand: Hand, joints: list[int], weights: Array) -> Array:
    """`(T, 63, A)` weighted derivatives of the joints by the angles, by differences."""
    columns = []
    for a in range(hand.angle_count):
        moved = angles.copy()
        moved[:, a] += DIFFERENCE_RAD
        change = (forward_kinematics(hand, moved)[0][:, joints] - positions) / DIFFERENCE_RAD
        columns.append((weights[..., None] * change).reshape(len(angles), -1))
    return np.stack(columns, axis=-1)
