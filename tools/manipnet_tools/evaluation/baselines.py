"""Hands that need no network: the mean training pose, a held pose, the nearest training frame's fingers."""

from collections.abc import Sequence

import numpy as np

from manipnet.geometry import Array, Side
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.model.features import features
from manipnet.synthesis.model.layout import Layout, layout_of
from manipnet.synthesis.synthesizer import HandState, windows_of
from manipnet_tools.evaluation.cases import Case
from manipnet_tools.takes.rollout import HandInput

RETRIEVE_EVERY = 3
"""Training frames kept for retrieval: at 20 Hz neighbours are all but equal."""


def mean_pose(train: Sequence[Case]) -> Array:
    """Mean captured joints of all training frames and both hands, `(22, 3)`."""
    return np.concatenate([p for case in train for p in case.captured.values()]).mean(axis=0)


def held(case: Case, positions: Array) -> dict[Side, Array]:
    """One pose `(22, 3)` for every frame of both hands."""
    return {side: np.broadcast_to(positions, captured.shape) for side, captured in case.captured.items()}


class Retrieval:
    """For every frame the fingers of the training frame with the nearest trajectories and surroundings.

    The surroundings are distances and directions from the joints of a hand that stays in the pose `hand`.
    """

    def __init__(self, train: Sequence[Case], hand: Hand, state: HandState) -> None:
        self._hand, self._state, self._blocks = hand, state, _blocks(layout_of(hand))
        rows, fingers = [], []
        for case in train:
            for side, seen in case.inputs.items():
                rows.append(self._rows(seen, slice(None, None, RETRIEVE_EVERY)))
                fingers.append(case.captured[side][::RETRIEVE_EVERY])
        keys, self._fingers = np.concatenate(rows), np.concatenate(fingers)
        self._weights = np.concatenate(
            [np.full(b.stop - b.start, 1.0 / np.sqrt(b.stop - b.start)) for b in self._blocks]
        ) / np.maximum(keys.std(axis=0), 1e-3)
        self._keys = keys * self._weights
        self._squares = (self._keys**2).sum(axis=1)

    def __call__(self, case: Case) -> dict[Side, Array]:
        """Fingers for both hands of a case, `(T, 22, 3)` by side."""
        return {side: self._fingers[self._nearest(seen)] for side, seen in case.inputs.items()}

    def _nearest(self, seen: HandInput) -> np.ndarray:
        rows = self._rows(seen, slice(None)) * self._weights
        return np.concatenate(
            [(self._squares - 2.0 * chunk @ self._keys.T).argmin(axis=1) for chunk in np.array_split(rows, 16)]
        )

    def _rows(self, seen: HandInput, ticks: slice) -> np.ndarray:
        windows = windows_of([seen.scene(tick) for tick in range(len(seen))[ticks]])
        count = len(windows.wrist)
        positions, rotations = (
            np.repeat(pose[None], count, axis=0) for pose in (self._state.positions, self._state.rotations)
        )
        rows = features(self._hand, seen.shapes[0], windows, positions, rotations)
        return np.concatenate([rows[:, block] for block in self._blocks], axis=1)


def _blocks(layout: Layout) -> tuple[slice, ...]:
    """The columns that frames are compared by."""
    return (
        layout.encoded["trajectory"],
        layout.input["signed_distances"].columns,
        layout.input["surface_normals"].columns,
    )
