"""One tick: from the poses of wrists and objects to the pose of every hand. It knows no clock, socket or file.

The same code runs live, in replay, offline, in training and in evaluation.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from manipnet.geometry import (
    Array,
    Side,
    compose,
    matrix_to_quat,
    mirror_points,
    mirror_poses,
    mirror_quats,
    quat_multiply,
    transform,
)
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.ik.grip import grip_size
from manipnet.synthesis.ik.pose import Poses, allocate_poses, pose_kernel
from manipnet.synthesis.ik.solvers import DEFAULT_SOLVER
from manipnet.synthesis.model.bundle import Bundle
from manipnet.synthesis.model.features import Windows, rays_of, sense
from manipnet.synthesis.model.layout import PRESENT, WINDOW
from manipnet.synthesis.objects.shape import Shape
from manipnet.synthesis.side_by_side import SideBySide, cuts, part_count

ABSENT_HAND_M = 0.45
"""Distance at which a hand that is not tracked is assumed to be."""
_SIGNS: dict[Side, Array] = {"left": mirror_poses(np.ones(7)), "right": np.ones(7)}
"""The signs that turn a pose into the one of a right hand."""


@dataclass(frozen=True, eq=False)
class HandScene:
    """What one hand can know at one tick: trajectories in the world, sampled at `layout.WINDOW_OFFSETS_S` about it."""

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
    """What a hand carries from tick to tick: the feedback pose, which is the shown pose minus part of the last
    correction, in the hand's own wrist frame, as a right hand."""

    angles: Array
    """`(A,)` radians."""
    positions: Array
    """`(J, 3)` metres."""
    rotations: Array
    """`(B, 3, 3)`."""
    correction: Array
    """`(A,)` what inverse kinematics added to the network's angles, radians."""
    grip: Array
    """`(G,)` what the hand remembers of its grip (`ik.grip`)."""


@dataclass(frozen=True, eq=False)
class HandStep:
    """The pose of one hand at one tick, in its own wrist frame, as a right hand."""

    state: HandState
    angles: Array
    """`(A,)` radians."""
    positions: Array
    """`(J, 3)` metres."""
    rotations: Array
    """`(B, 3, 3)`."""
    distances: Array
    """`(J,)` joint to surface as predicted, metres, in [0, 0.035]."""
    raw_positions: Array
    """`(J, 3)` before inverse kinematics."""


def state_of(hand: Hand, angles: Array) -> HandState:
    """The state of a hand posed by `angles (A,)`."""
    grip = np.zeros(grip_size(len(hand.fingers), len(angles)))
    return HandState(angles, *forward_kinematics(hand, angles), np.zeros(len(angles)), grip)


def hand_to_world(side: Side, T_world_wrist: Array, positions: Array, rotations: Array) -> tuple[Array, Array]:
    """Carry poses from the canonical wrist frame to the world, mirroring a left hand back.

    `T_world_wrist (..., 7)` is the real wrist, `positions (..., J, 3)`, `rotations (..., B, 3, 3)`. Returns
    positions `(..., J, 3)` and quaternions `(..., B, 4)`.
    """
    quats = matrix_to_quat(rotations)
    if side == "left":
        positions, quats = mirror_points(positions), mirror_quats(quats)
    wrist = T_world_wrist[..., None, :]
    return transform(wrist, positions), quat_multiply(wrist[..., 3:], quats)


def windows_of(scenes: Sequence[HandScene]) -> Windows:
    """Scenes as the network sees them, left hands mirrored into right ones."""
    windows = _allocate_windows(len(scenes))
    for n, scene in enumerate(scenes):
        _put_scene(windows, n, scene)
    return windows


def _allocate_windows(count: int) -> Windows:
    shape = (count, WINDOW)
    return Windows(
        np.empty((*shape, 7)), np.empty((*shape, 3)), np.empty((*shape, 7)), np.empty(count, np.bool_), np.empty(count)
    )


def _put_scene(windows: Windows, n: int, scene: HandScene) -> None:
    signs = _SIGNS[scene.side]
    np.multiply(scene.wrist, signs, windows.wrist[n])
    np.multiply(scene.object, signs, windows.object[n])
    np.multiply(_other_positions(scene), signs[:3], windows.other_wrist[n])
    windows.mirrored[n], windows.scale[n] = scene.side == "left", scene.scale


def _other_positions(scene: HandScene) -> Array:
    if scene.other_wrist is not None:
        return scene.other_wrist[:, :3]
    aside = np.array([0.0, 0.0, ABSENT_HAND_M, 0.0, 0.0, 0.0, 1.0])
    return compose(scene.wrist[PRESENT], aside)[:3]


class Synthesizer:
    """Steps any number of hands by one tick, as one batch through the network."""

    def __init__(
        self,
        bundle: Bundle,
        solver: str = DEFAULT_SOLVER,
        on_stage: Callable[[str], None] = lambda _: None,
    ) -> None:
        """`solver` is a name in `ik.solvers.SOLVERS`; raises `UnknownSolverError` for any other.

        `on_stage` is called with the name of each stage when it ends: `sense`, `infer`, `ik`.
        """
        self._bundle, self._pose, self._on_stage = bundle, pose_kernel(solver), on_stage
        self._batches: dict[int, _Batch] = {}
        self._threads = SideBySide()

    @property
    def hand(self) -> Hand:
        """The hand that is posed."""
        return self._bundle.hand

    def rest_state(self) -> HandState:
        """The neutral pose every hand starts from."""
        return state_of(self._bundle.hand, self._bundle.rest_angles)

    def step(self, scenes: Sequence[HandScene], states: Sequence[HandState]) -> list[HandStep]:
        """The next pose of each hand, from its scene at this tick and its state after the last one."""
        if not scenes:
            return []
        count, bundle = len(scenes), self._bundle
        hand, layout = bundle.hand, bundle.layout
        if count not in self._batches:
            self._batches[count] = _Batch(bundle, count)
        batch, poses = self._batches[count], allocate_poses(hand, count)
        first_at: dict[int, int] = {}
        order = sorted(range(count), key=lambda index: first_at.setdefault(id(scenes[index].shape), index))
        for n, index in enumerate(order):
            batch.put(n, scenes[index], states[index])
            poses.correction[n], poses.grip[n] = states[index].correction, states[index].grip
        parts = _parts([scenes[index] for index in order], len(batch.rays))

        def sense_part(part: int) -> None:
            for shape, first, last in parts[part]:
                inputs = batch.windows, batch.positions, batch.rotations
                sense(hand, layout, shape, *inputs, first, last, batch.rays[part], batch.rows)

        def pose_part(part: int) -> None:
            network = batch.outputs, batch.angles, bundle.response, bundle.limits
            for shape, first, last in parts[part]:
                self._pose(hand.packed, layout.output_starts, shape.solid, batch.windows, *network, first, last, poses)

        self._threads.run(sense_part, len(parts))
        self._on_stage("sense")
        batch.infer()
        self._on_stage("infer")
        self._threads.run(pose_part, len(parts))
        steps = dict(zip(order, _steps(poses), strict=True))
        self._on_stage("ik")
        return [steps[index] for index in range(count)]


class _Batch:
    """The kernels' inputs for a number of hands: allocated once, filled at every tick."""

    def __init__(self, bundle: Bundle, count: int) -> None:
        self.windows = _allocate_windows(count)
        self.angles, self.positions, self.rotations = allocate_poses(bundle.hand, count)[:3]
        self.rays = [rays_of(bundle.hand, count) for _ in range(part_count(count))]
        """For each part of the batch that is sensed by a thread of its own."""
        self.rows = np.empty((count, bundle.layout.input_size), np.float32)
        self.infer, self.outputs = bundle.bind(self.rows)

    def put(self, n: int, scene: HandScene, state: HandState) -> None:
        """Make a hand number `n`."""
        _put_scene(self.windows, n, scene)
        self.angles[n], self.positions[n], self.rotations[n] = state.angles, state.positions, state.rotations


_Group = tuple[Shape, int, int]
"""Neighbouring hands about the same shape: the shape, the first hand, one past the last."""


def _parts(scenes: Sequence[HandScene], count: int) -> list[list[_Group]]:
    """The hands in these scenes in `count` parts of about the same size, each in groups."""
    shapes = [scene.shape for scene in scenes]
    if count == 1:
        return [_groups(shapes, 0, len(shapes))]
    held = [(id(scene.shape), scene.object[PRESENT].tobytes()) for scene in scenes]
    return [_groups(shapes, begin, end) for begin, end in pairwise(cuts(held, count))]


def _groups(shapes: Sequence[Shape], begin: int, end: int) -> list[_Group]:
    starts = [n for n in range(begin, end) if n == begin or shapes[n] is not shapes[n - 1]]
    return [(shapes[first], first, last) for first, last in pairwise([*starts, end])]


def _steps(poses: Poses) -> Iterator[HandStep]:
    for n in range(len(poses.angles)):
        hand = Poses(*(array[n] for array in poses))
        feedback = hand.feedback_angles, hand.feedback_positions, hand.feedback_rotations
        state = HandState(*feedback, hand.correction, hand.grip)
        yield HandStep(state, hand.angles, hand.positions, hand.rotations, hand.distances, hand.raw_positions)
