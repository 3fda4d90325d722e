"""Whether the rows of an evaluation move as captured hands do: a classifier, and the distance of motions as clouds."""

from dataclasses import dataclass

import numpy as np

from manipnet.geometry import Array
from manipnet_tools.evaluation.cases import Case
from manipnet_tools.evaluation.results import CAPTURED, Hands, Results
from manipnet_tools.evaluation.two_sample import Standard, covered, frechet_distance, left_out_auc
from manipnet_tools.evaluation.windows import shaken, window_rows

FLOOR, CEILING = "captured, halves", "captured + 3° noise"
"""The captured hands' first halves against their second halves, and against themselves with noise added."""
FEWEST_WINDOWS = 40


@dataclass(frozen=True)
class Realism:
    """How far a row is from the captured hands.

    `auc` is the classifier's, 0.5 where it cannot tell; nan for fewer than two takes. `precision` is the share of the
    row's windows that resemble captured ones, `recall` the share of captured windows that resemble the row's.
    """

    auc: float
    frechet: float
    precision: float
    recall: float


def realism(results: Results) -> dict[str, Realism]:
    """The realism of every row but the captured, between the floor and the ceiling that belong to it.

    The result is empty if the takes have fewer than 40 windows in all, which is ten seconds of both hands.
    """
    windows = {
        name: [_both_hands(case, row.hands[take]) for take, case in results.cases.items()]
        for name, row in results.rows.items()
    }
    captured = windows.pop(CAPTURED)
    if sum(len(rows) for hands in captured for rows in hands) < FEWEST_WINDOWS:
        return {}
    rng = np.random.default_rng(0)
    noisy = [
        _both_hands(case, {side: shaken(case.hand, positions, rng) for side, positions in case.captured.items()})
        for case in results.cases.values()
    ]
    halves = [[np.array_split(rows, 2) for rows in hands] for hands in captured]
    first, second = ([[hand[half] for hand in hands] for hands in halves] for half in (0, 1))
    return {
        FLOOR: _compared(first, second),
        **{name: _compared(captured, rows) for name, rows in windows.items()},
        CEILING: _compared(captured, noisy),
    }


def _both_hands(case: Case, hands: Hands) -> list[Array]:
    return [window_rows(case, side, positions) for side, positions in hands.items()]


def _compared(captured: list[list[Array]], others: list[list[Array]]) -> Realism:
    """Compare the windows of takes, each a list of hands."""
    truths, rows = ([np.concatenate(hands) for hands in takes] for takes in (captured, others))
    standard = Standard.of(np.concatenate(truths))
    truth, row = (standard(np.concatenate(takes)) for takes in (truths, rows))
    return Realism(left_out_auc(truths, rows), frechet_distance(truth, row), covered(row, truth), covered(truth, row))
