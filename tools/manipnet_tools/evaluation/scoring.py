"""Scores of hands on a test case, their averages, and the targets."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from math import inf, nan
from typing import Literal

import numpy as np

from manipnet.geometry import Array
from manipnet_tools.evaluation.options import EvaluationProtocol


@dataclass(frozen=True)
class Score:
    """Measures of one hand on one case; nan if the case has no such frames, or if the measure was not requested.

    `ratio` is the joint error relative to the mean training pose's, on frames near the object; `near_mm` is that error.
    `contact_f1_many` also accepts the captured contacts of other moments with the same wrist pose, and `touching`
    counts capsules per held frame. The other fields that end in `_ratio`, and `idle_energy`, are relative to the
    captured fingers on the same frames. The physics and drop shares belong to the take, so both hands have the same.
    """

    ratio: float = nan
    near_mm: float = nan
    mpjpe_mm: float = nan
    tip_mm: float = nan
    drift_s: float = nan
    contact_f1: float = nan
    contact_f1_many: float = nan
    finger_recall: float = nan
    touching: float = nan
    touching_ratio: float = nan
    penetration_cm: float = nan
    over_1cm: float = nan
    deep: float = nan
    slide_mm_s: float = nan
    slide_ratio: float = nan
    smoothness: float = nan
    smoothness_ratio: float = nan
    idle_ratio: float = nan
    idle_energy: float = nan
    opening_mm: float = nan
    opening_ratio: float = nan
    opening_s: float = nan
    self_mm: float = nan
    self_95_mm: float = nan
    physics: float = nan
    physics_paper: float = nan
    drop_right: float = nan
    drop_left: float = nan
    drop_both: float = nan


def average(scores: Iterable[Score]) -> Score:
    """Mean of each measure over the hands and takes that have it; the longest drift is the longest of all."""
    rows = [asdict(one) for one in scores]
    means = {name: _mean_of(_finite([row[name] for row in rows])) for name in rows[0]}
    return Score(**means | {"drift_s": max(row["drift_s"] for row in rows)})


def _mean_of(values: Array) -> float:
    return float(values.mean()) if len(values) else nan


def _finite(values: list[float]) -> Array:
    array = np.array(values)
    return array[np.isfinite(array)]


@dataclass(frozen=True)
class Target:
    """Bounds, ends included, on a measure, on its difference from the captured fingers', or on its ratio to theirs."""

    measure: str
    text: str
    low: float
    high: float
    relation: Literal["own", "difference", "ratio"] = "own"

    def value(self, ours: Score, captured: Score) -> float:
        """The number that must be within the bounds."""
        own, theirs = getattr(ours, self.measure), getattr(captured, self.measure)
        if self.relation == "difference":
            return own - theirs
        return own / theirs if self.relation == "ratio" else own

    def met(self, ours: Score, captured: Score) -> bool:
        """Whether the bounds hold; they do not for a measure without frames."""
        return bool(self.low <= self.value(ours, captured) <= self.high)


_ALWAYS = (
    Target("drop_right", "drop test, right hand alone, over the captured", 0.95, inf, "ratio"),
    Target("drop_left", "drop test, left hand alone, over the captured", 0.95, inf, "ratio"),
    Target("touching_ratio", "touching capsules of a held object over the captured", 0.85, 1.15),
    Target("slide_ratio", "slide of fingertips over the captured", 0.0, 1.1),
    Target("idle_ratio", "idle hands, smoothness over the captured", 0.0, 1.0),
)
TARGETS: dict[EvaluationProtocol, tuple[Target, ...]] = {
    "seen": (
        Target("ratio", "joint error over the mean pose's, near the object", 0.0, 0.50),
        Target("penetration_cm", "penetration above the captured, cm", -inf, 0.03, "difference"),
        Target("physics", "physics share against the captured", -0.01, inf, "difference"),
        Target("smoothness_ratio", "smoothness over the captured", 0.85, 1.15),
        Target("contact_f1", "contact F1", 0.92, 1.0),
        Target("deep", "frames 1.5 cm deep above the captured", -inf, 0.005, "difference"),
        *_ALWAYS,
    ),
    "unseen": (
        Target("ratio", "joint error over the mean pose's, near the object", 0.0, 0.65),
        Target("penetration_cm", "penetration above the captured, cm", -inf, 0.05, "difference"),
        Target("physics", "physics share against the captured", -0.01, inf, "difference"),
        Target("smoothness_ratio", "smoothness over the captured", 0.8, 1.2),
        Target("contact_f1", "contact F1", 0.87, 1.0),
        Target("deep", "frames 1.5 cm deep above the captured", -inf, 0.01, "difference"),
        *_ALWAYS,
    ),
}
"""The targets of the product, for averages over takes and both hands, with inverse kinematics."""
