"""Finds the unit and handedness of a file, which it does not state, from the size and shape of its hands."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from manipnet.geometry import Array, Side, mirror_points, mirror_poses
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.objects.units import UNITS_M
from manipnet_tools.importing.retarget import fit_hand, model_joints
from manipnet_tools.importing.source import ImportingError

SIZE_RATIOS: Final = (0.5, 1.6)
"""How large a hand may be, relative to the model's."""
CLEARLY_BETTER: Final = 0.7
_TRIED_FRAMES: Final = 24
_MIDDLE: Final = (0, 9, 10, 11)


@dataclass(frozen=True)
class Space:
    """How a file's lengths become metres in a right-handed world."""

    unit: str
    mirrored: bool

    def points(self, points: Array) -> Array:
        """Points `(..., 3)` of the file, in metres and right-handed."""
        return UNITS_M[self.unit] * (mirror_points(points) if self.mirrored else points)

    def poses(self, poses: Array) -> Array:
        """Poses `(..., 7)` of the file, in metres and right-handed."""
        poses = mirror_poses(poses) if self.mirrored else poses
        return np.concatenate([UNITS_M[self.unit] * poses[..., :3], poses[..., 3:]], axis=-1)


def find_space(hands: dict[Side, Array], hand: Hand) -> Space:
    """The unit and handedness of joints `(T, 21, 3)` in a file's own lengths. Raises `ImportingError`."""
    unit = _unit(hands, hand)
    sample: dict[Side, Array] = {side: _sample(UNITS_M[unit] * joints) for side, joints in hands.items()}
    better = {
        side: _error(mirror_points(joints), side, hand) < CLEARLY_BETTER * _error(joints, side, hand)
        for side, joints in sample.items()
    }
    if len(set(better.values())) > 1:
        side = next(side for side, mirrored in better.items() if mirrored)
        raise ImportingError(f"the joints called {side} are those of the other hand; exchange left and right")
    return Space(unit, all(better.values()))


def _unit(hands: dict[Side, Array], hand: Hand) -> str:
    """The unit in which the middle fingers, from the wrist on, are as long as those of people."""
    flat = forward_kinematics(hand, np.zeros(hand.angle_count))[0][model_joints(hand)]
    model = _length(flat[np.newaxis, list(_MIDDLE)])
    for side, joints in hands.items():
        if not np.isfinite(joints[:, _MIDDLE]).all(axis=(1, 2)).any():
            raise ImportingError(f"the {side} hand has no frame with its wrist and its whole middle finger")
    lengths = [_length(joints[:, _MIDDLE]) for joints in hands.values()]
    ratios = {unit: float(np.median(lengths)) * metres / model for unit, metres in UNITS_M.items()}
    unit = min(ratios, key=lambda unit: abs(np.log(max(ratios[unit], 1e-9))))
    if not SIZE_RATIOS[0] <= ratios[unit] <= SIZE_RATIOS[1]:
        raise ImportingError(
            f"the middle fingers are {np.median(lengths):.3g} long, measured from the wrist to the last joint, "
            f"and that does not fit a hand in any unit ({', '.join(UNITS_M)}); check the order of the joints"
        )
    return unit


def _length(points: Array) -> float:
    """The median length of lines `(T, K, 3)`."""
    return float(np.nanmedian(np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)))


def _sample(joints: Array) -> Array:
    """A few frames `(N, 21, 3)` spread over a take."""
    seen = joints[np.isfinite(joints[:, _MIDDLE]).all(axis=(1, 2))]
    return seen[:: max(len(seen) // _TRIED_FRAMES, 1)]


def _error(joints: Array, side: Side, hand: Hand) -> float:
    """The median error of a fit, metres; infinite for joints that do not fit at all."""
    try:
        return float(np.nanmedian(fit_hand(joints, side, hand).error_m))
    except ImportingError:
        return np.inf
