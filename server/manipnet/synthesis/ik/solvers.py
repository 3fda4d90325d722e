"""The table of solvers: what corrects the network's pose so that fingers touch the object and do not enter it.

A new solver is one entry here. This module imports no compiled code, so that a command line can list the solvers;
`pose.pose_kernel` imports and compiles the one in use.
"""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class Solver:
    """One way to correct a pose."""

    name: str
    help: str
    """One line for a person who chooses."""
    correct: str
    """`module:function` of its compiled step; `correction` describes the arguments."""
    improve: str = "manipnet.synthesis.ik.holding:leave_grips"
    """`module:function` that looks after the grips of all hands when they are posed."""


_CORRECTION: Final = "manipnet.synthesis.ik.correction"
SOLVERS: Final = {
    solver.name: solver
    for solver in (
        Solver(
            "least_squares",
            "damped least squares on joints and surfaces",
            f"{_CORRECTION}:correct_by_least_squares",
        ),
        Solver(
            "wrench",
            "least squares with contacts that carry what is held",
            f"{_CORRECTION}:correct_by_wrench",
            "manipnet.synthesis.ik.holding:improve_grips",
        ),
        Solver("ccd", "the paper's cyclic coordinate descent", f"{_CORRECTION}:correct_by_ccd"),
        Solver("none", "no correction", f"{_CORRECTION}:correct_nothing"),
    )
}
"""Every solver by name."""
DEFAULT_SOLVER: Final = "wrench"


class UnknownSolverError(ValueError):
    """A solver that is not in the table; the text lists those that are."""


def solver_named(name: str) -> Solver:
    """The solver of this name. Raises `UnknownSolverError`."""
    if name not in SOLVERS:
        raise UnknownSolverError(f"solver {name!r} is unknown; allowed are {', '.join(SOLVERS)}")
    return SOLVERS[name]
