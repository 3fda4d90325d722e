"""The drop test on a case: the share of frames held by the right hand alone, by the left hand alone and by both."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from manipnet import geometry
from manipnet.geometry import SIDES, Side
from manipnet_tools.evaluation import metrics
from manipnet_tools.evaluation.cases import Case
from manipnet_tools.evaluation.drop import DropTest
from manipnet_tools.evaluation.results import Hands

FRAMES = 60
"""At most this many frames of a cell are simulated, spread over all of them."""
FEWEST = 10
"""A cell with fewer frames has no share."""


@dataclass(frozen=True)
class Cell:
    """The frames in which the captured hands of these sides, and no other, touch the lifted object."""

    sides: tuple[Side, ...]
    frames: NDArray[np.int64]


def cells(case: Case, most: int = FRAMES) -> dict[str, Cell]:
    """The cells `drop_right`, `drop_left` and `drop_both` of a case, each with at most `most` frames."""
    touches = {side: case.gaps[side].closest < metrics.CONTACT_M for side in SIDES}
    counts = case.lifted & metrics.settled(len(case))
    masks: dict[str, tuple[tuple[Side, ...], metrics.Mask]] = {
        "drop_right": (("right",), touches["right"] & ~touches["left"]),
        "drop_left": (("left",), touches["left"] & ~touches["right"]),
        "drop_both": (SIDES, touches["right"] & touches["left"]),
    }
    return {name: Cell(sides, _spread(np.flatnonzero(mask & counts), most)) for name, (sides, mask) in masks.items()}


def _spread(frames: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    if len(frames) <= most:
        return frames
    return frames[np.linspace(0, len(frames) - 1, most).round().astype(int)]


class DropCells:
    """Judges hands on one case. The object's models are built once for all of them."""

    def __init__(self, case: Case, most: int = FRAMES) -> None:
        self._case, self.cells = case, cells(case, most)
        self._tests = {count: DropTest(case.shape, case.hand, count) for count in (1, 2)}
        up = geometry.quat_rotate(geometry.quat_conjugate(case.T_world_object[:, 3:]), np.array([0.0, 1.0, 0.0]))
        self._down = -up

    def __len__(self) -> int:
        """The number of frames that are simulated for each row."""
        return sum(len(cell.frames) for cell in self.cells.values())

    def shares(self, hands: Hands, advance: Callable[[int], None] = lambda n: None) -> dict[str, float]:
        """The share held in each cell; nan where it has fewer than ten frames.

        `hands` are joints `(T, J, 3)` by side in the canonical wrist frame; `advance` receives the frames done.
        """
        on_object: Hands = {side: self._case.on_object(side, p) for side, p in hands.items()}
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            held = {
                name: list(pool.map(lambda frame, cell=cell: self._held(on_object, cell, frame, advance), cell.frames))
                for name, cell in self.cells.items()
            }
        return {name: float(np.mean(of)) if len(of) >= FEWEST else float("nan") for name, of in held.items()}

    def _held(self, on_object: Hands, cell: Cell, frame: int, advance: Callable[[int], None]) -> bool:
        fall = self._tests[len(cell.sides)].fall([on_object[side][frame] for side in cell.sides], self._down[frame])
        advance(1)
        return fall.held
