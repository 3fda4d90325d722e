"""Judges hands on one case by the measures that were requested."""

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from manipnet.geometry import Array, Side
from manipnet_tools.evaluation import guards, metrics, physics, regrasps
from manipnet_tools.evaluation.cases import Case
from manipnet_tools.evaluation.metrics import Gaps, Mask
from manipnet_tools.evaluation.options import MeasureGroup
from manipnet_tools.evaluation.results import Hands
from manipnet_tools.evaluation.scoring import Score

if TYPE_CHECKING:
    from manipnet_tools.evaluation.drop_cells import DropCells


class Judge:
    """What the measures prepare once for a case; `mean_pose (J, 3)` is the training data's."""

    def __init__(self, case: Case, mean_pose: Array, groups: Collection[MeasureGroup]) -> None:
        self._of_hand: dict[Side, HandJudge] = {side: HandJudge(case, side, mean_pose) for side in case.captured}
        self._case, self._scored = case, "scores" in groups
        self._drop = _drop_cells(case) if "drop" in groups else None

    @property
    def drops(self) -> int:
        """The number of frames that the drop test simulates for each row."""
        return len(self._drop) if self._drop else 0

    def __call__(self, hands: Hands, advance: Callable[[int], None] = lambda n: None) -> dict[Side, Score]:
        """The scores of `hands` by side; `advance` receives the number of frames that were dropped."""
        scores: dict[Side, Score] = dict.fromkeys(hands, Score())
        if self._scored:
            gaps: dict[Side, Gaps] = {side: self._case.gaps_of(side, positions) for side, positions in hands.items()}
            shares = _physics_shares(self._case, gaps)
            scores = {
                side: replace(self._of_hand[side].score(positions, gaps[side]), **shares)
                for side, positions in hands.items()
            }
        if self._drop:
            shares = self._drop.shares(hands, advance)
            scores = {side: replace(one, **shares) for side, one in scores.items()}
        return scores


def _drop_cells(case: Case) -> "DropCells":
    from manipnet_tools.evaluation.drop_cells import DropCells  # needs mujoco

    return DropCells(case)


def _physics_shares(case: Case, gaps: dict[Side, Gaps]) -> dict[str, float]:
    lifted, body = case.lifted & metrics.settled(len(case)), physics.body_of(case.shape)
    remainder = physics.residuals(list(gaps.values()), case.needed, body)
    strict = physics.residuals(list(gaps.values()), case.needed_paper, body, physics.PAPER)
    shallow = np.min([gap.closest for gap in gaps.values()], axis=0) > -metrics.DEEP_M
    return {
        "physics": physics.explained_share(remainder, lifted),
        "physics_paper": physics.explained_share(strict, lifted & shallow, physics.PAPER),
    }


class HandJudge:
    """The measures of one hand of a case, without its first second, and what they need of the captured hand."""

    def __init__(self, case: Case, side: Side, mean_pose: Array) -> None:
        self._case = case
        self._side: Side = side
        self._hand, self._captured, self._gaps = case.hand, case.captured[side], case.gaps[side]
        self._counts = metrics.settled(len(case))
        self._near, self._idle = metrics.near(self._gaps) & self._counts, metrics.idle(self._gaps) & self._counts
        self._held = case.lifted & self._counts & (self._gaps.closest < metrics.CONTACT_M)
        self._mean_error = metrics.joint_error_m(np.broadcast_to(mean_pose, self._captured.shape), self._captured)
        self._answers = regrasps.regrasps(case.hand, case.on_object(side, self._captured))

    def score(self, positions: Array, gaps: Gaps) -> Score:
        """The score of joints `(T, J, 3)` in the canonical wrist frame with these gaps."""
        measures = self._errors(positions) | self._contacts(positions, gaps) | self._motion(positions)
        return Score(**measures)

    def _errors(self, positions: Array) -> dict[str, float]:
        error = metrics.joint_error_m(positions, self._captured)
        tips = metrics.fingertip_error_m(self._hand, positions, self._captured)
        return {
            "ratio": _mean(error, self._near) / _mean(self._mean_error, self._near),
            "near_mm": 1e3 * _mean(error, self._near),
            "mpjpe_mm": 1e3 * _mean(error, self._counts),
            "tip_mm": 1e3 * _mean(tips, self._counts),
            "drift_s": metrics.longest_drift_s(error[self._counts]),
        }

    def _contacts(self, positions: Array, gaps: Gaps) -> dict[str, float]:
        ours, theirs = gaps[self._counts], self._gaps[self._counts]
        touching = guards.touching_capsules(gaps, self._held)
        slide = self._slide(positions, gaps)
        return {
            "contact_f1": metrics.contact_f1(ours, theirs),
            "contact_f1_many": regrasps.contact_f1(gaps, self._gaps, self._answers, self._counts),
            "finger_recall": regrasps.finger_recall(self._hand, ours, theirs),
            "touching": touching,
            "touching_ratio": touching / guards.touching_capsules(self._gaps, self._held),
            "penetration_cm": metrics.penetration_cm(ours),
            "over_1cm": metrics.deeper_share(ours),
            "deep": metrics.deep_frames(ours),
            "slide_mm_s": slide,
            "slide_ratio": slide / self._slide(self._captured, self._gaps),
        }

    def _slide(self, positions: Array, gaps: Gaps) -> float:
        p_object = self._case.on_object(self._side, positions)
        return metrics.slide_mm_s(self._hand, p_object[self._counts], gaps[self._counts])

    def _motion(self, positions: Array) -> dict[str, float]:
        smoothness = metrics.smoothness_cm_s2(positions, self._counts)
        opening = guards.opening(self._hand, positions, self._gaps)
        captured_opening = guards.opening(self._hand, self._captured, self._gaps)
        overlap = 1e3 * guards.self_overlap_m(self._hand, positions)[self._counts]
        return {
            "smoothness": smoothness,
            "smoothness_ratio": smoothness / metrics.smoothness_cm_s2(self._captured, self._counts),
            "idle_ratio": metrics.smoothness_cm_s2(positions, self._idle)
            / metrics.smoothness_cm_s2(self._captured, self._idle),
            "idle_energy": guards.energy_m2_s2(positions, self._idle) / guards.energy_m2_s2(self._captured, self._idle),
            "opening_mm": 1e3 * opening.peak_m,
            "opening_ratio": opening.peak_m / captured_opening.peak_m,
            "opening_s": opening.before_s,
            "self_mm": float(overlap.mean()),
            "self_95_mm": float(np.percentile(overlap, 95)),
        }


def _mean(values: Array, frames: Mask) -> float:
    return float(values[frames].mean()) if frames.any() else float("nan")
