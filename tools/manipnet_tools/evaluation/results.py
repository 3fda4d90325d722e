"""The rows of an evaluation: hands and their scores, by name."""

from dataclasses import dataclass, field

from manipnet.geometry import Array, Side
from manipnet_tools.evaluation.cases import Case
from manipnet_tools.evaluation.options import EvaluationProtocol
from manipnet_tools.evaluation.scoring import Score, average

Hands = dict[Side, Array]
"""Joints `(T, J, 3)` by side, in the canonical wrist frame."""
CAPTURED, MEAN, NEAREST, HOLD = "captured fingers", "mean pose", "nearest frame", "hold"
"""Names of the rows without a network."""
FINGERS = "fingers"
"""The name of the row of files that `manipnet synthesize` wrote."""


@dataclass(frozen=True)
class Fold:
    """The cases that a model may have been trained on, and those that it is tested on."""

    name: str
    """The take left out, or `seen`."""
    train: list[Case]
    test: list[Case]


@dataclass(frozen=True)
class Row:
    """One kind of hands on every test case, by the name of the case: their joints and their scores."""

    hands: dict[str, Hands] = field(default_factory=dict)
    scores: dict[str, dict[Side, Score]] = field(default_factory=dict)

    @property
    def average(self) -> Score:
        """The average over takes and both hands."""
        return average(score for sides in self.scores.values() for score in sides.values())


@dataclass(frozen=True)
class Results:
    """All rows of one protocol, by name, and the cases that were tested, by name."""

    protocol: EvaluationProtocol
    cases: dict[str, Case]
    rows: dict[str, Row]


def row_name(model: str, solver: str) -> str:
    """The name of the row of a model with a solver."""
    return f"{model}, no IK" if solver == "none" else f"{model}, {solver.replace('_', ' ')}"
