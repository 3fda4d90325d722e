"""Test material: the dataset's takes at the live ticks, the captured fingers kept apart as ground truth."""

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
from manipnet_tools.takes.rollout import HandInput, Ticks, hand_inputs, tick_take
from manipnet_tools.takes.take import Take, read_take

SEEN_SHARE = 0.8
"""Of every take, the first part that the protocol *seen* trains on; the rest is its test."""


class DataError(ValueError):
    """A folder that is not the dataset; the text says what is missing."""


@dataclass(frozen=True)
class Case:
    """A stretch of one take: what the synthesis gets (`inputs`) and what it is judged by (all else).

    `captured` joints `(T, 22, 3)` by side are in the canonical wrist frame, `needed` and `needed_paper (T, 6)`
    the wrenches that explain the object's motion, `lifted (T,)` says where it is off the table; both are
    derived from the whole take.
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
        """Gaps of a hand with joints `(T, 22, 3)` in the canonical wrist frame, worn on this take's wrist."""
        return metrics.capsule_gaps(self.hand, self._in_world(side, positions), self.T_world_object, self.shape)

    def on_object(self, side: Side, positions: Array) -> Array:
        """The joints of such a hand in the object's frame, `(T, 22, 3)`."""
        return geometry.transform(geometry.invert(self.T_world_object)[:, None], self._in_world(side, positions))

    def _in_world(self, side: Side, positions: Array) -> Array:
        p_wrist = geometry.mirror_points(positions) if side == "left" else positions
        return geometry.transform(self.ticks.bodies[f"{side}_wrist"].poses[:, None], p_wrist)


def load_cases(data: Path, names: tuple[str, ...] = ()) -> list[Case]:
    """All takes of the dataset folder (or those named) with the meshes in `meshes/`; raises `DataError`."""
    return [load_case(read_take(folder), data / "meshes") for folder in data_folders(data, names)]


def data_folders(data: Path, names: tuple[str, ...] = ()) -> list[Path]:
    """The takes `data/BVH/<take>/`, all or those named; raises `DataError`."""
    folders = sorted(path for path in (data / "BVH").glob("*") if path.is_dir())
    if not folders:
        raise DataError(f"{data}: no takes; expected folders BVH/<take>/ with the dataset's BVH files")
    found = {path.name: path for path in folders}
    unknown = set(names) - found.keys()
    if unknown:
        raise DataError(f"{data}: no take {sorted(unknown)}; there are {sorted(found)}")
    return [found[name] for name in names or found]


def load_case(take: Take, meshes: Path) -> Case:
    """One take on the object it handles, whose mesh is `meshes/<object>.obj`; raises `DataError`."""
    if len(take.objects) != 1 or set(take.fingers) != set(SIDES):
        raise DataError(f"{take.name}: needs one object and both hands' fingers, has {list(take.objects)}")
    path = meshes / f"{take.objects[0]}.obj"
    if not path.is_file():
        raise DataError(f"{take.name}: no mesh {path}")
    subject, shape, ticks = shipped_hand(), load_shape(path), tick_take(take)
    body, T_world_object = physics.body_of(shape), ticks.bodies[take.objects[0]].poses
    world: dict[Side, Array] = {side: captured_at(take, side, ticks.time_s) for side in SIDES}
    return Case(
        take.name,
        subject,
        take.objects[0],
        shape,
        ticks,
        hand_inputs(ticks, {take.objects[0]: shape}),
        {side: _in_wrist(side, p, ticks.bodies[f"{side}_wrist"].poses) for side, p in world.items()},
        {side: metrics.capsule_gaps(subject, p, T_world_object, shape) for side, p in world.items()},
        physics.wrench_needed(T_world_object, body),
        physics.wrench_needed(T_world_object, body, physics.PAPER),
        physics.lifted(T_world_object, body),
        float(take.time_s[-1] - take.time_s[0]),
    )


def captured_at(take: Take, side: Side, time_s: Array) -> Array:
    """Captured joints in the world `(T, 22, 3)` at times from the take's first frame, interpolated."""
    positions = take.fingers[side].positions
    flat = positions.reshape(len(take.time_s), -1)
    at = take.time_s - take.time_s[0]
    return np.stack([np.interp(time_s, at, column) for column in flat.T], axis=1).reshape(-1, *positions.shape[1:])


def _in_wrist(side: Side, p_world: Array, T_world_wrist: Array) -> Array:
    positions = geometry.transform(geometry.invert(T_world_wrist)[:, None], p_world)
    return geometry.mirror_points(positions) if side == "left" else positions
