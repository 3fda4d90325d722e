"""Test cases: the dataset's takes at the live ticks; the captured fingers are kept apart as ground truth."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from manipnet import geometry
from manipnet.geometry import SIDES, Array, Side
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.shape import Shape, load_shape
from manipnet_tools.evaluation import metrics, physics
from manipnet_tools.evaluation.metrics import Gaps, Mask
from manipnet_tools.takes.dataset import DataError, mesh_file, take_folders
from manipnet_tools.takes.rollout import HandInput, Ticks, hand_inputs, tick_take
from manipnet_tools.takes.take import Take, read_take

SEEN_SHARE = 0.8
"""The share of every take, from its start, that the protocol *seen* trains on; it tests on the rest."""


@dataclass(frozen=True)
class Case:
    """A stretch of one take: what the synthesis receives (`inputs`), and what its result is compared with.

    `captured` joints `(T, J, 3)` by side are in the canonical wrist frame. `needed` and `needed_paper (T, 6)` are the
    wrenches that explain the object's motion, and `lifted (T,)` says where it is off the table; they are derived from
    the whole take.
    """

    name: str
    hand: Hand
    """The hand that was captured, whose capsules touch."""
    object: str
    shape: Shape
    ticks: Ticks
    inputs: dict[Side, HandInput]
    captured: dict[Side, Array]
    gaps: dict[Side, Gaps]
    needed: Array
    needed_paper: Array
    lifted: Mask
    take_s: float
    """Length of the whole take."""

    def __len__(self) -> int:
        return len(self.ticks.time_s)

    @property
    def T_world_object(self) -> Array:  # noqa: N802
        """Poses of the mesh frame, `(T, 7)`."""
        return self.ticks.bodies[self.object].poses

    def part(self, start: float, stop: float) -> "Case":
        """The stretch between two fractions of the whole take."""
        first, last = np.searchsorted(self.ticks.time_s, [start * self.take_s, stop * self.take_s])
        return self[first:last]

    def __getitem__(self, ticks: slice) -> "Case":
        return replace(
            self,
            ticks=self.ticks[ticks],
            inputs={side: seen[ticks] for side, seen in self.inputs.items()},
            captured={side: positions[ticks] for side, positions in self.captured.items()},
            gaps={side: gaps[ticks] for side, gaps in self.gaps.items()},
            needed=self.needed[ticks],
            needed_paper=self.needed_paper[ticks],
            lifted=self.lifted[ticks],
        )

    def gaps_of(self, side: Side, positions: Array) -> Gaps:
        """Gaps of a hand with joints `(T, J, 3)` in the canonical wrist frame, at this take's wrist."""
        return metrics.capsule_gaps(self.hand, self._in_world(side, positions), self.T_world_object, self.shape)

    def on_object(self, side: Side, positions: Array) -> Array:
        """The joints of such a hand in the object's frame, `(T, J, 3)`."""
        return geometry.transform(geometry.invert(self.T_world_object)[:, None], self._in_world(side, positions))

    def in_wrist(self, side: Side, p_world: Array) -> Array:
        """Joints in the world `(T, J, 3)` in the canonical wrist frame at this take's wrist."""
        return _in_wrist(side, p_world, self.ticks.bodies[f"{side}_wrist"].poses)

    def _in_world(self, side: Side, positions: Array) -> Array:
        p_wrist = geometry.mirror_points(positions) if side == "left" else positions
        return geometry.transform(self.ticks.bodies[f"{side}_wrist"].poses[:, None], p_wrist)


def load_cases(data: Path, names: tuple[str, ...] = ()) -> list[Case]:
    """All takes of the dataset, or those named, with their meshes. Raises `DataError`."""
    return [load_case(read_take(folder), data) for folder in take_folders(data, names)]


def load_case(take: Take, data: Path) -> Case:
    """One take of the dataset with the object that it handles. Raises `DataError`."""
    if len(take.objects) != 1 or set(take.fingers) != set(SIDES):
        objects = ", ".join(take.objects) or "none"
        raise DataError(f"{take.name}: needs one object and the fingers of both hands; its objects are {objects}")
    name = take.objects[0]
    subject, shape, ticks = take.hand or shipped_hand(), load_shape(mesh_file(data, name)), tick_take(take)
    body, T_world_object = physics.body_of(shape), ticks.bodies[name].poses
    world: dict[Side, Array] = {side: captured_at(take, side, ticks.time_s) for side in SIDES}
    return Case(
        take.name,
        subject,
        name,
        shape,
        ticks,
        hand_inputs(ticks, {name: shape}),
        {side: _in_wrist(side, p, ticks.bodies[f"{side}_wrist"].poses) for side, p in world.items()},
        {side: metrics.capsule_gaps(subject, p, T_world_object, shape) for side, p in world.items()},
        physics.wrench_needed(T_world_object, body),
        physics.wrench_needed(T_world_object, body, physics.PAPER),
        physics.lifted(T_world_object, body),
        float(take.time_s[-1] - take.time_s[0]),
    )


def captured_at(take: Take, side: Side, time_s: Array) -> Array:
    """Captured joints in the world `(T, J, 3)`, interpolated at times from the take's first frame."""
    positions = take.fingers[side].positions
    flat = positions.reshape(len(take.time_s), -1)
    at = take.time_s - take.time_s[0]
    return np.stack([np.interp(time_s, at, column) for column in flat.T], axis=1).reshape(-1, *positions.shape[1:])


def _in_wrist(side: Side, p_world: Array, T_world_wrist: Array) -> Array:
    positions = geometry.transform(geometry.invert(T_world_wrist)[:, None], p_world)
    return geometry.mirror_points(positions) if side == "left" else positions
