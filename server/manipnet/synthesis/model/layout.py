"""The one declaration of what goes into the network and what comes out (paper, section 6.1: 2356 in, 220 out).

Every block is in the hand's own wrist frame at the present tick, in SI units; a left hand's scene is mirrored before.
The sizes follow from the hand's joints and sensors.
"""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.model.providers import MAX_LOOK_AHEAD_S

WINDOW_OFFSETS_S: Final = np.linspace(-MAX_LOOK_AHEAD_S, MAX_LOOK_AHEAD_S, 21)
"""Trajectory samples about the present tick."""
WINDOW: Final = len(WINDOW_OFFSETS_S)
WINDOW_STEP_S: Final = 0.05
PRESENT: Final = 10
"""Index of the present in the window."""
SENSED: Final = np.array([10, 12, 14, 16, 18, 20])
"""Window samples at which the sensors look: now, +0.1 … +0.5 s."""
AMBIENT_CELLS: Final = 10
"""Cells of the ambient grid along each edge."""

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


class InputColumns(NamedTuple):
    """The first column of each input block, for compiled code."""

    joint_positions: int
    joint_axes: int
    wrist_positions: int
    wrist_axes: int
    other_wrist_distances: int
    object_centers: int
    object_angular_velocities: int
    ambient: int
    proximity: int
    signed_distances: int
    surface_normals: int


class OutputColumns(NamedTuple):
    """The first column of each output block, for compiled code."""

    joint_positions: int
    joint_axes: int
    distances: int


class Layout:
    """Blocks of the network's inputs and outputs for a hand with so many joints and proximity sensors."""

    def __init__(self, joints: int, sensors: int) -> None:
        sensed = len(SENSED)
        self.input = _blocks(
            ("joint_positions", (joints, 3)),
            ("joint_axes", (joints, 2, 3)),
            ("wrist_positions", (WINDOW, 3)),
            ("wrist_axes", (WINDOW, 2, 3)),
            ("other_wrist_distances", (WINDOW,)),
            ("object_centers", (WINDOW, 3)),
            ("object_angular_velocities", (WINDOW, 3)),
            ("ambient", (AMBIENT_CELLS, AMBIENT_CELLS, AMBIENT_CELLS)),
            ("proximity", (sensed, sensors)),
            ("signed_distances", (sensed, joints)),
            ("surface_normals", (joints, 3)),
        )
        """Input blocks by name, in order."""
        self.output = _blocks(
            ("joint_positions", (joints, 3)),
            ("joint_axes", (joints, 2, 3)),
            ("distances", (joints,)),
        )
        """Output blocks by name, in order."""
        self.input_size = self.input["surface_normals"].stop
        self.output_size = self.output["distances"].stop
        self.input_starts = np.array([self.input[name].start for name in InputColumns._fields])
        self.output_starts = np.array([self.output[name].start for name in OutputColumns._fields])
        """Of the blocks, in the order of `InputColumns` and `OutputColumns`: as arguments of kernels."""
        self.encoded = {
            "pose": slice(0, self.input["joint_axes"].stop),
            "trajectory": slice(self.input["wrist_positions"].start, self.input["object_angular_velocities"].stop),
            "sensors": slice(self.input["ambient"].start, self.input["surface_normals"].stop),
        }
        """Input columns of the three encoders (paper, figure 7)."""

    def describe(self) -> dict[str, list]:
        """The layout as plain data, written into every bundle and checked when one is loaded."""
        return {
            side: [[block.name, list(block.shape)] for block in blocks.values()]
            for side, blocks in (("input", self.input), ("output", self.output))
        }


def layout_of(hand: Hand) -> Layout:
    """The layout for a hand."""
    return Layout(hand.joint_count, hand.sensor_count)


def _blocks(*blocks: tuple[str, tuple[int, ...]]) -> dict[str, Block]:
    layout, start = {}, 0
    for name, shape in blocks:
        layout[name] = Block(name, shape, start)
        start = layout[name].stop
    return layout
