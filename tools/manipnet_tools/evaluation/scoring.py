"""Scores of hands on a test case, their averages, and the targets."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from math import nan

import numpy as np

from manipnet.geometry import Array, Side
from manipnet_tools.evaluation import metrics, physics
from manipnet_tools.evaluation.cases import Case


@dataclass(frozen=True)
class Score:
    """Measures of one hand on one case; nan if the case has no such frames, or if the measure was not asked for.

    `ratio` is the joint error relative to the mean training pose's, on frames near the object; `near_mm` is that error.
    `smoothness_ratio` and `idle_ratio` are relative to the captured fingers on the same frames. The physics
    and drop shares belong to the take, so both hands have the same.
    """

    ratio: float = nan
    near_mm: float = nan
    mpjpe_mm: float = nan
    tip_mm: float = nan
    drift_s: float = nan
    contact_f1: float = nan
    penetration_cm: float = nan
    over_1cm: float = nan
    deep: float = nan
    slide_mm_s: float = nan
    smoothness: float = nan
    smoothness_ratio: float = nan
    idle_ratio: float = nan
    physics: float = nan
    physics_paper: float = nan
    drop_right: float = nan
    drop_left: float = nan
    drop_both: float = nan


def score(case: Case, mean_pose: Array, hands: dict[Side, Array]) -> dict[Side, Score]:
    """Score `hands`, joints `(T, J, 3)` by side in the canonical wrist frame, without the first second.

    `mean_pose (J, 3)` is the training data's, to which `ratio` is relative.
    """
    counts = metrics.settled(len(case))
    gaps = {side: case.gaps_of(side, positions) for side, positions in hands.items()}
    body = physics.body_of(case.shape)
    lifted = case.lifted & counts
    remainder = physics.residuals(list(gaps.values()), case.needed, body)
    strict = physics.residuals(list(gaps.values()), case.needed_paper, body, physics.PAPER)
    shallow = np.min([gap.closest for gap in gaps.values()], axis=0) > -metrics.DEEP_M
    shares = {
        "physics": physics.explained_share(remainder, lifted),
        "physics_paper": physics.explained_share(strict, lifted & shallow, physics.PAPER),
    }
    return {
        side: Score(**_of_hand(case, side, mean_pose, positions, gaps[side], counts), **shares)
        for side, positions in hands.items()
    }


def _of_hand(
    case: Case, side: Side, mean_pose: Array, positions: Array, gaps: metrics.Gaps, counts: metrics.Mask
) -> dict[str, float]:
    captured, captured_gaps = case.captured[side], case.gaps[side]
    near, idle = metrics.near(captured_gaps) & counts, metrics.idle(captured_gaps) & counts
    error = metrics.joint_error_m(positions, captured)
    reference = metrics.joint_error_m(np.broadcast_to(mean_pose, captured.shape), captured)
    smoothness = metrics.smoothness_cm_s2(positions, counts)
    return {
        "ratio": _mean(error[near]) / _mean(reference[near]),
        "near_mm": 1e3 * _mean(error[near]),
        "mpjpe_mm": 1e3 * _mean(error[counts]),
        "tip_mm": 1e3 * _mean(metrics.fingertip_error_m(case.hand, positions, captured)[counts]),
        "drift_s": metrics.longest_drift_s(error[counts]),
        "contact_f1": metrics.contact_f1(gaps[counts], captured_gaps[counts]),
        "penetration_cm": metrics.penetration_cm(gaps[counts]),
        "over_1cm": metrics.deeper_share(gaps[counts]),
        "deep": metrics.deep_frames(gaps[counts]),
        "slide_mm_s": metrics.slide_mm_s(case.hand, case.on_object(side, positions)[counts], gaps[counts]),
        "smoothness": smoothness,
        "smoothness_ratio": smoothness / metrics.smoothness_cm_s2(captured, counts),
        "idle_ratio": metrics.smoothness_cm_s2(positions, idle) / metrics.smoothness_cm_s2(captured, idle),
    }


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else float("nan")


def average(scores: Iterable[Score]) -> Score:
    """Mean of each measure over the hands and takes that have it; the longest drift is the longest of all."""
    rows = [asdict(one) for one in scores]
    means = {name: _mean(_finite([row[name] for row in rows])) for name in rows[0]}
    return Score(**means | {"drift_s": max(row["drift_s"] for row in rows)})


def _finite(values: list[float]) -> Array:
    array = np.array(values)
    return array[np.isfinite(array)]


@dataclass(frozen=True)
class Target:
    """Bounds, ends included, on one measure or on its difference from the captured fingers'."""

    measure: str
    text: str
    low: float
    high: float
    over_captured: bool = False

    def value(self, ours: Score, captured: Score) -> float:
        """The number that must be within the bounds."""
        own = getattr(ours, self.measure)
        return own - getattr(captured, self.measure) if self.over_captured else own

    def met(self, ours: Score, captured: Score) -> bool:
        """Whether the bounds hold; they do not for a measure without frames."""
        return bool(self.low <= self.value(ours, captured) <= self.high)


INF = float("inf")
TARGETS = {
    "seen": (
        Target("ratio", "joint error over the mean pose's, near the object", 0.0, 0.50),
        Target("penetration_cm", "penetration above the captured, cm", -INF, 0.03, over_captured=True),
        Target("physics", "physics share against the captured", -0.01, INF, over_captured=True),
        Target("smoothness_ratio", "smoothness over the captured", 0.85, 1.15),
        Target("contact_f1", "contact F1", 0.92, 1.0),
        Target("deep", "frames 1.5 cm deep above the captured", -INF, 0.005, over_captured=True),
        Target("idle_ratio", "idle hands, smoothness over the captured", 0.0, 1.0),
    ),
    "unseen": (
        Target("ratio", "joint error over the mean pose's, near the object", 0.0, 0.65),
        Target("penetration_cm", "penetration above the captured, cm", -INF, 0.05, over_captured=True),
        Target("physics", "physics share against the captured", -0.02, INF, over_captured=True),
        Target("smoothness_ratio", "smoothness over the captured", 0.8, 1.2),
        Target("contact_f1", "contact F1", 0.87, 1.0),
        Target("deep", "frames 1.5 cm deep above the captured", -INF, 0.01, over_captured=True),
        Target("idle_ratio", "idle hands, smoothness over the captured", 0.0, 1.0),
    ),
}
"""The targets of the product, for averages over takes and both hands, with inverse kinematics."""
