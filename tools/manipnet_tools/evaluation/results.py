"""The rows of an evaluation and what they are called."""

from dataclasses import dataclass, field
from typing import Literal

from manipnet.geometry import Array, Side
from manipnet_tools.evaluation.cases import Case
from manipnet_tools.evaluation.scoring import Score, average

Protocol = Literal["seen", "unseen"]


Hands = dict[Side, Array]


CAPTURED, MEAN, NEAREST, HOLD = "captured fingers", "mean pose", "nearest frame", "hold"


@dataclass(frozen=True)
class Fold:
    """What a model may have been trained on and what it is tested on."""

    name: str
    """The take left out, or `seen`."""
    train: list[Case]
    test: list[Case]


@dataclass(frozen=True)
class Row:
    """One kind of hands on every test case: joints in the canonical wrist frame and their scores."""

    hands: dict[str, Hands] = field(default_factory=dict)
    scores: dict[str, dict[Side, Score]] = field(default_factory=dict)

    @property
    def average(self) -> Score:
        """Over takes and both hands."""
        return average(score for sides in self.scores.values() for score in sides.values())


@dataclass(frozen=True)
class Results:
    """All rows of one protocol; `cases` are what was tested, by name."""

    protocol: Protocol
    cases: dict[str, Case]
    rows: dict[str, Row]


def row_name(model: str, solver: str) -> str:
    """What the row of a model with a solver is called."""
    return f"{model}, no IK" if solver == "none" else f"{model}, {solver.replace('_', ' ')}"
