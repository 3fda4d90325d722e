"""Judges hands on one case by the measures that were asked for."""

from collections.abc import Callable, Collection
from dataclasses import replace

from manipnet.geometry import Array, Side
from manipnet_tools.evaluation.cases import Case
from manipnet_tools.evaluation.options import Measures
from manipnet_tools.evaluation.results import Hands
from manipnet_tools.evaluation.scoring import Score, score


class Judge:
    """What the measures prepare once for a case; `mean_pose (J, 3)` is the training data's."""

    def __init__(self, case: Case, mean_pose: Array, measures: Collection[Measures]) -> None:
        self._case, self._mean_pose, self._measures = case, mean_pose, measures
        self._drop = _drop_cells(case) if "drop" in measures else None

    @property
    def drops(self) -> int:
        """The number of frames that the drop test simulates for each row."""
        return len(self._drop) if self._drop else 0

    def __call__(self, hands: Hands, advance: Callable[[int], None] = lambda n: None) -> dict[Side, Score]:
        """The scores of `hands` by side; `advance` receives the number of frames that were dropped."""
        scores = {side: Score() for side in hands}
        if "scores" in self._measures:
            scores = score(self._case, self._mean_pose, hands)
        if self._drop:
            shares = self._drop.shares(hands, advance)
            scores = {side: replace(one, **shares) for side, one in scores.items()}
        return scores


def _drop_cells(case: Case):
    from manipnet_tools.evaluation.drop_cells import DropCells  # needs mujoco

    return DropCells(case)
