"""One tick: from where wrists and objects are to the pose of every hand. No clock, no sockets, no files.

The same code runs live, in replay, offline, in training and in evaluation.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from manipnet.geometry import (
    Array,
    compose,
    matrix_to_quat,
    mirror_points,
    mirror_poses,
    mirror_quats,
    quat_multiply,
    transform,
)
from manipnet.hand.kinematics import forward_kinematics, forward_kinematics_into
from manipnet.ik.correct import CORRECTIONS, SOLVERS, SolverName
from manipnet.network.bundle import Bundle
from manipnet.network.decode import decode_into
from manipnet.network.features import Windows, features
from manipnet.network.layout import PRESENT
from manipnet.objects.shape import Shape

Side = Literal["left", "right"]
ABSENT_HAND_M = 0.45
"""Distance at which a hand that is not tracked is assumed to be."""


@dataclass(frozen=True, eq=False)
class HandScene:
    """What one hand can know at one tick: world trajectories sampled at `WINDOW_OFFSETS_S` about it."""

    side: Side
    wrist: Array
    """`(21, 7)`."""
    other_wrist: Array | None
    """`(21, 7)`, or None where the other hand is not tracked."""
    object: Array
    """`(21, 7)` poses of the object's mesh frame."""
    shape: Shape
    scale: float = 1.0


@dataclass(frozen=True, eq=False)
class HandState:
    """What a hand carries from tick to tick: its pose in its own wrist frame, as a right hand."""

    angles: Array
    """`(20,)` radians."""
    positions: Array
    """`(22, 3)` metres."""
    rotations: Array
    """`(17, 3, 3)`."""
    correction: Array
    """`(20,)` what inverse kinematics added to the network's angles, radians."""


@dataclass(frozen=True, eq=False)
class HandStep:
    """The pose of one hand at one tick, in its own wrist frame, as a right hand."""

    state: HandState
    distances: Array
    """`(22,)` joint to surface as predicted, metres, in [0, 0.035]."""
    raw_positions: Array
    """`(22, 3)` before inverse kinematics."""


def state_of(angles: Array) -> HandState:
    """The state of a hand posed by `angles (20,)`."""
    return HandState(angles, *forward_kinematics(angles), np.zeros(len(angles)))


def hand_to_world(side: Side, T_world_wrist: Array, positions: Array, rotations: Array) -> tuple[Array, Array]:
    """Carry poses from the canonical wrist frame to the world, mirroring a left hand back.

    `T_world_wrist (..., 7)` is the real wrist, `positions (..., 22, 3)`, `rotations (..., 17, 3, 3)`. Returns
    positions `(..., 22, 3)` and quaternions `(..., 17, 4)`.
    """
    quats = matrix_to_quat(rotations)
    if side == "left":
        positions, quats = mirror_points(positions), mirror_quats(quats)
    wrist = T_world_wrist[..., None, :]
    return transform(wrist, positions), quat_multiply(wrist[..., 3:], quats)


def windows_of(scenes: Sequence[HandScene]) -> Windows:
    """Scenes as the network sees them: left hands mirrored into right ones."""
    mirrored = np.array([scene.side == "left" for scene in scenes])
    wrist, obj = np.stack([s.wrist for s in scenes]), np.stack([s.object for s in scenes])
    other = np.stack([_other_positions(scene) for scene in scenes])
    wrist[mirrored], obj[mirrored] = mirror_poses(wrist[mirrored]), mirror_poses(obj[mirrored])
    other[mirrored] = mirror_points(other[mirrored])
    return Windows(wrist, other, obj, mirrored, np.array([float(scene.scale) for scene in scenes]))


def _other_positions(scene: HandScene) -> Array:
    if scene.other_wrist is not None:
        return scene.other_wrist[:, :3]
    aside = np.array([[0.0, 0.0, ABSENT_HAND_M, 0.0, 0.0, 0.0, 1.0]])
    return np.repeat(compose(scene.wrist[PRESENT : PRESENT + 1], aside)[:, :3], len(scene.wrist), axis=0)


class Synthesizer:
    """Steps any number of hands by one tick, as one batch through the network."""

    def __init__(
        self,
        bundle: Bundle,
        solver: SolverName = "least_squares",
        on_stage: Callable[[str], None] = lambda _: None,
    ) -> None:
        """`on_stage` hears the name of each stage as it ends: `sense`, `infer`, `ik`."""
        if solver not in SOLVERS:
            raise ValueError(f"solver {solver!r} is unknown; allowed are {', '.join(SOLVERS)}")
        self._bundle, self._correct, self._on_stage = bundle, CORRECTIONS.get(solver), on_stage

    def rest_state(self) -> HandState:
        """The neutral pose every hand starts from."""
        return state_of(self._bundle.rest_angles)

    def step(self, scenes: Sequence[HandScene], states: Sequence[HandState]) -> list[HandStep]:
        """The next pose of each hand, from its scene at this tick and its state after the last one."""
        if not scenes:
            return []
        windows = windows_of(scenes)
        groups = _by_shape(scenes)
        positions = np.stack([state.positions for state in states])
        rotations = np.stack([state.rotations for state in states])
        rows = [
            features(shape, _subset(windows, members), positions[members], rotations[members])
            for shape, members in groups
        ]
        self._on_stage("sense")
        outputs = self._bundle.infer(rows[0] if len(rows) == 1 else np.concatenate(rows)).astype(np.float64)
        self._on_stage("infer")
        steps: list[HandStep | None] = [None] * len(scenes)
        order = np.concatenate([members for _, members in groups])
        for output, index in zip(outputs, order, strict=True):
            steps[index] = self._pose(output, scenes[index], states[index], windows, index)
        self._on_stage("ik")
        return [step for step in steps if step is not None]

    def _pose(self, output: Array, scene: HandScene, state: HandState, windows: Windows, index: int) -> HandStep:
        shape, bundle = scene.shape, self._bundle
        angles, distances, correction = np.empty(20), np.empty(22), state.correction.copy()
        raw_positions, positions = np.empty((22, 3)), np.empty((22, 3))
        rotations, axes = np.empty((17, 3, 3)), np.empty((20, 3))
        decode_into(output, state.angles, bundle.response, bundle.limits, rotations, angles, distances)
        forward_kinematics_into(angles, raw_positions, rotations, axes)
        if self._correct is None:
            return HandStep(HandState(angles, raw_positions, rotations, correction), distances, raw_positions)
        self._correct(
            shape.bvh,
            shape.field,
            shape.exact_within_m,
            windows.wrist[index],
            windows.object[index],
            windows.mirrored[index],
            windows.scale[index],
            raw_positions,
            distances,
            bundle.limits,
            angles,
            correction,
        )
        forward_kinematics_into(angles, positions, rotations, axes)
        return HandStep(HandState(angles, positions, rotations, correction), distances, raw_positions)


def _by_shape(scenes: Sequence[HandScene]) -> list[tuple[Shape, np.ndarray]]:
    members: dict[int, list[int]] = {}
    for index, scene in enumerate(scenes):
        members.setdefault(id(scene.shape), []).append(index)
    return [(scenes[indices[0]].shape, np.array(indices)) for indices in members.values()]


def _subset(windows: Windows, members: np.ndarray) -> Windows:
    if len(members) == len(windows.wrist):
        return windows
    return Windows(*(values[members] for values in windows))
