"""The one declaration of what goes into the network and what comes out (paper, section 6.1: 2356 in, 220 out).

Every block is in the hand's own wrist frame at the present tick (SI units), the left hand after mirroring the scene.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from manipnet.synthesis.model.providers import MAX_LOOK_AHEAD_S

WINDOW_OFFSETS_S: Final = np.linspace(-MAX_LOOK_AHEAD_S, MAX_LOOK_AHEAD_S, 21)
"""Trajectory samples about the present tick."""
WINDOW_STEP_S: Final = 0.05
PRESENT: Final = 10
"""Index of the present in the window."""
SENSED: Final = np.array([10, 12, 14, 16, 18, 20])
"""Window samples at which the sensors look: now, +0.1 … +0.5 s."""

OUTPUT_DISTANCE_MAX_M: Final = 0.035
"""Predicted distances are clamped to [0, this]."""


@dataclass(frozen=True)
class Block:
    """A named stretch of a feature vector."""

    name: str
    shape: tuple[int, ...]
    start: int

    @property
    def stop(self) -> int:
        """One past its last column."""
        return self.start + math.prod(self.shape)

    @property
    def columns(self) -> slice:
        """Its columns."""
        return slice(self.start, self.stop)


def _layout(*blocks: tuple[str, tuple[int, ...]]) -> dict[str, Block]:
    layout, start = {}, 0
    for name, shape in blocks:
        layout[name] = Block(name, shape, start)
        start = layout[name].stop
    return layout


INPUT: Final = _layout(
    ("joint_positions", (22, 3)),
    ("joint_axes", (22, 2, 3)),
    ("wrist_positions", (21, 3)),
    ("wrist_axes", (21, 2, 3)),
    ("other_wrist_distances", (21,)),
    ("object_centers", (21, 3)),
    ("object_angular_velocities", (21, 3)),
    ("ambient", (10, 10, 10)),
    ("proximity", (6, 104)),
    ("signed_distances", (6, 22)),
    ("surface_normals", (22, 3)),
)
OUTPUT: Final = _layout(
    ("joint_positions", (22, 3)),
    ("joint_axes", (22, 2, 3)),
    ("distances", (22,)),
)
INPUT_SIZE: Final = max(block.stop for block in INPUT.values())
OUTPUT_SIZE: Final = max(block.stop for block in OUTPUT.values())

ENCODED: Final = {
    "pose": slice(0, INPUT["joint_axes"].stop),
    "trajectory": slice(INPUT["wrist_positions"].start, INPUT["object_angular_velocities"].stop),
    "sensors": slice(INPUT["ambient"].start, INPUT["surface_normals"].stop),
}
"""Columns of the three encoders (paper, figure 7)."""


def describe() -> dict[str, list]:
    """The layout as plain data, written into every bundle and checked when one is loaded."""
    return {
        side: [[b.name, list(b.shape)] for b in blocks.values()]
        for side, blocks in (("input", INPUT), ("output", OUTPUT))
    }
