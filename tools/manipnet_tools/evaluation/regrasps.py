"""Contact F1 against all the ways in which the subject grasped: his fingers now, and at other moments of the take.

The wrist's pose on the object leaves the fingers a choice, of which the captured moment shows only one.
"""

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet.tracking.tick import TICK_HZ
from manipnet_tools.evaluation.metrics import CONTACT_M, Gaps, Mask

SAME_GRASP_M = 0.01
"""Wrist poses are the same if the wrist and the knuckles are this near each other on the object (root mean square)."""
OTHER_MOMENT_FRAMES = round(0.5 * TICK_HZ)


def regrasps(hand: Hand, p_object: Array) -> list[NDArray[np.int64]]:
    """For every frame the frames with the same wrist pose, half a second or more away, and the frame itself.

    `p_object (T, J, 3)` are captured joints in the object's frame.
    """
    rigid = np.unique(hand.capsules[hand.capsules[:, 0] == 0])  # the wrist and where the palm's capsules end
    rows = p_object[:, rigid].reshape(len(p_object), -1)
    squares = (rows**2).sum(axis=1)
    distance = np.maximum(squares[:, None] + squares - 2.0 * rows @ rows.T, 0.0) / len(rigid)
    frame = np.arange(len(rows))
    apart = np.abs(frame[:, None] - frame) >= OTHER_MOMENT_FRAMES
    same = (distance < SAME_GRASP_M**2) & apart | (frame[:, None] == frame)
    return [np.flatnonzero(row) for row in same]


def contact_f1(gaps: Gaps, captured: Gaps, answers: list[NDArray[np.int64]], frames: Mask) -> float:
    """F1 of touching capsules, each of `frames (T,)` against that of its `answers` which it agrees with best.

    The counts of all frames are added, as in `metrics.contact_f1`; nan if nothing touches.
    """
    ours, theirs = gaps.gap < CONTACT_M, captured.gap < CONTACT_M
    sizes = theirs.sum(axis=1)
    common, total = 0, 0
    for k in np.flatnonzero(frames):
        among = answers[k]
        both, sums = theirs[among] @ ours[k].astype(np.int64), sizes[among] + ours[k].sum()
        best = np.argmax(np.where(sums > 0, 2.0 * both / np.maximum(sums, 1), 1.0))
        common, total = common + both[best], total + sums[best]
    return float(2.0 * common / total) if total else float("nan")


def finger_recall(hand: Hand, gaps: Gaps, captured: Gaps) -> float:
    """Share of the captured hand's touching fingers, over all frames, which touch in ours too; nan if none touches."""
    ours, theirs = touching_fingers(hand, gaps), touching_fingers(hand, captured)
    return float((ours & theirs).sum() / theirs.sum()) if theirs.any() else float("nan")


def touching_fingers(hand: Hand, gaps: Gaps) -> Mask:
    """Which fingers have a capsule within 5 mm of the surface, `(T, F)`."""
    owned = [np.isin(hand.capsules, finger).all(axis=1) for finger in hand.fingers]
    return np.stack([(gaps.gap[:, capsules] < CONTACT_M).any(axis=1) for capsules in owned], axis=1)
