"""Which samples of bodies cannot be real, judged by what each body did before: the kernel of `outlier_gate`."""

from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel

MAX_SPEED_M_S: Final = 20.0
MAX_SPIN_RAD_S: Final = 40.0
MARGIN_M: Final = 0.1
MARGIN_RAD: Final = 0.5
"""No hand, and nothing in a hand, moves faster than this by more than a margin for noise."""
CONFIRM_S: Final = 0.2
"""A jump is believed when the body has stayed where it jumped to for this long."""
FORGET_S: Final = 1.0
"""After this long without an accepted sample, or this far back in time, a body is accepted wherever it appears."""
SWAP_SPEED_M_S: Final = 4.0
SWAP_RATIO: Final = 0.25
"""Two bodies were swapped if both moved faster than this and each is now near the other's old place: nearer than this
share of the distance between the two places.
"""
NOISE_M: Final = (2e-6, 1e-3)
NOISE_TURNS: Final = 20
"""Noise reverses direction at most small steps; real motion does not. A body that has shown this many more small steps
back than forth along one axis has noise, so it can never be perfectly still. Smaller steps may be those of rounding.
"""
FROZEN_S: Final = 0.5
MOVING_S: Final = 0.1
"""A body is frozen if it has not changed for `FROZEN_S` while others of its sender did within `MOVING_S`."""

FAULTS: Final = ("jump", "swap", "zeros", "frozen")
"""Why a body is rejected; kernels count them from 1, and 0 is no fault."""
_JUMP, _SWAP, _ZEROS, _FROZEN = 1, 2, 3, 4
FAULT: Final = 7
"""The column of a sample after its pose."""

HISTORY: Final = np.dtype(
    [
        ("is_known", "i8"),
        ("t_s", "f8"),
        ("pose", "f8", (7,)),
        ("jumped_s", "f8"),
        ("has_candidate", "i8"),
        ("candidate_s", "f8"),
        ("candidate", "f8", (7,)),
        ("step", "f8", (3,)),
        ("noise_turns", "i8", (3,)),
        ("has_noise", "i8"),
        ("changed_s", "f8"),
    ]
)
"""One body: its newest accepted sample, the place it may have jumped to, and what is known of its noise.

`noise_turns` are, by axis, how many more small steps were back than forth.
"""


@kernel
def judge(histories: np.ndarray, rows: np.ndarray, samples: Array, t_s: float, moved_s: float):
    """Judge the bodies of one frame by their histories, and update those.

    `samples (n, 8)` are their poses, and then a number that is not zero for a body that is not tracked; the faults of
    the others are written there. `moved_s` is when a body of the sender changed last. Returns whether one has changed
    now, and whether one has a fault.
    """
    _find_swaps(histories, rows, samples, t_s)
    changed = faulty = False
    for i in range(len(rows)):
        history, pose = histories[rows[i]], samples[i]
        if pose[FAULT] > 0.0:
            continue
        swapped = pose[FAULT] < 0.0
        pose[FAULT] = 0.0
        if history["is_known"] == 0:
            history["is_known"] = 1
            history["changed_s"] = t_s
            _accept(history, t_s, t_s, pose)
            continue
        # If nothing moves, a recording has ended or is paused, and no single body is frozen.
        others_move = (0.0 if changed else t_s - moved_s) < MOVING_S
        pose[FAULT] = _fault(history, t_s, pose, swapped, others_move)
        changed = changed or history["changed_s"] == t_s
        faulty = faulty or pose[FAULT] > 0.0
    return changed, faulty


@inner
def _find_swaps(histories: np.ndarray, rows: np.ndarray, samples: Array, t_s: float):
    """Make the faults of bodies -1 that exchanged their places in one step, as they do when a tracker confuses two."""
    for i in range(len(rows)):
        if samples[i, FAULT] > 0.0 or not _is_fast(histories[rows[i]], samples[i], t_s):
            continue
        for j in range(i):
            if samples[j, FAULT] > 0.0 or not _is_fast(histories[rows[j]], samples[j], t_s):
                continue
            one, other = histories[rows[i]]["pose"], histories[rows[j]]["pose"]
            if max(_dist(samples[i], other), _dist(samples[j], one)) < SWAP_RATIO * _dist(one, other):
                samples[i, FAULT] = samples[j, FAULT] = -1.0


@inner
def _is_fast(history, pose: Array, t_s: float):
    """Whether a body moved so fast that it may have been taken for another."""
    elapsed_s = t_s - history["t_s"]
    recent = history["is_known"] == 1 and 0.0 < elapsed_s < CONFIRM_S
    return recent and _dist(pose, history["pose"]) > SWAP_SPEED_M_S * elapsed_s


@inner
def _fault(history, t_s: float, pose: Array, swapped: bool, others_move: bool):
    """Why a tracked sample cannot be real, or 0; updates the history."""
    elapsed_s = t_s - history["t_s"]
    if elapsed_s < -FORGET_S:
        _accept(history, t_s, t_s, pose)
        return 0
    if pose[0] == 0.0 and pose[1] == 0.0 and pose[2] == 0.0 and _dist(pose, history["pose"]) > MARGIN_M:
        return _ZEROS
    if _is_still(history, t_s, pose) and others_move:
        return _FROZEN
    if elapsed_s > FORGET_S:
        _accept(history, t_s, t_s, pose)
        return 0
    if not swapped and _is_near(history["pose"], pose, abs(elapsed_s)) and _is_back(history, pose):
        _accept(history, t_s, history["t_s"], pose)
        return 0
    if history["has_candidate"] == 0 or not _is_near(history["candidate"], pose, abs(t_s - history["candidate_s"])):
        history["jumped_s"] = t_s
    history["has_candidate"] = 1
    history["candidate_s"] = t_s
    _copy(pose, history["candidate"])
    if t_s - history["jumped_s"] < CONFIRM_S:
        return _SWAP if swapped else _JUMP
    _accept(history, t_s, history["t_s"], pose)
    return 0


@inner
def _accept(history, t_s: float, newest_s: float, pose: Array):
    if t_s >= newest_s:  # a late sample is accepted but is not the newest
        history["t_s"] = t_s
        _copy(pose, history["pose"])
    history["has_candidate"] = 0


@inner
def _is_near(known: Array, pose: Array, elapsed_s: float):
    """Whether a body can have moved from a known pose to a new one within `elapsed_s`."""
    if _dist(known, pose) > MARGIN_M + MAX_SPEED_M_S * elapsed_s:
        return False
    return _angle(known, pose) <= MARGIN_RAD + MAX_SPIN_RAD_S * elapsed_s


@inner
def _is_back(history, pose: Array):
    """Whether a body that jumped is nearer to where it came from than to where it went."""
    return history["has_candidate"] == 0 or _distance_m(history["pose"], pose) < _distance_m(history["candidate"], pose)


@inner
def _is_still(history, t_s: float, pose: Array):
    """Whether a body with noise has been bit-identical for long; learns the noise.

    A body without noise is computed, not tracked, such as a recorded prop on a table; it may be still.
    """
    same = True
    for k in range(7):
        same = same and pose[k] == history["pose"][k]
    if same:
        return history["has_noise"] == 1 and t_s - history["changed_s"] > FROZEN_S
    if history["has_noise"] == 0:
        _learn_noise(history, pose)
    history["changed_s"] = t_s
    return False


@inner
def _learn_noise(history, pose: Array):
    for axis in range(3):
        one, before, turns = pose[axis] - history["pose"][axis], history["step"][axis], history["noise_turns"]
        if NOISE_M[0] < abs(one) < NOISE_M[1]:
            turns[axis] = turns[axis] + 1 if one * before < 0.0 else max(turns[axis] - 1, 0)
            if turns[axis] >= NOISE_TURNS:
                history["has_noise"] = 1
        history["step"][axis] = one


@inner
def _copy(pose: Array, out: Array):
    for k in range(7):
        out[k] = pose[k]


@inner
def _dist(one: Array, other: Array):
    return np.sqrt((one[0] - other[0]) ** 2 + (one[1] - other[1]) ** 2 + (one[2] - other[2]) ** 2)


@inner
def _angle(one: Array, other: Array):
    cosine = abs(one[3] * other[3] + one[4] * other[4] + one[5] * other[5] + one[6] * other[6])
    return 2.0 * np.arccos(min(cosine, 1.0))


@inner
def _distance_m(one: Array, other: Array):
    """Position and rotation in one measure: the rim of a body is about a decimetre from its centre."""
    return _dist(one, other) + 0.1 * _angle(one, other)
