"""The drop test: whether the fingers of one frame hold the object against gravity in a simulator (MuJoCo).

Its contact model is independent of the solvers' and of `physics`. The capsules of the hand hang on soft springs, those
that touch press, and then gravity acts for half a second. Everything is in the object's frame, SI units.
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from manipnet import geometry
from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.objects.shape import Shape
from manipnet_tools.evaluation import metrics
from manipnet_tools.evaluation.metrics import Gaps, Mask
from manipnet_tools.evaluation.physics import GRAVITY_M_S2
from manipnet_tools.evaluation.shell import shell_pieces

OBJECT_KG, FRICTION = 0.2, 0.8
SPRING_N_M, CAPSULE_KG = 2000.0, 0.02
PRESS_M = 0.002
OVERLAP_M = 0.003
"""Deeper capsules are moved out to this depth first, or the simulator would throw the object away."""
SETTLE_S, FALL_S = 0.2, 0.5
SETTLE_RATE_HZ = 100.0
"""While the grip settles, the object's own speed decays at this rate, so that a push from one side moves it aside
instead of throwing it."""
MOVED_M, TURNED = 0.02, np.radians(45.0)
_AWAY = np.array([0.0, 0.0, 10.0])
_HAND_BIT, _OBJECT_BIT = 1, 2
"""Collision bits: a capsule meets the pieces of the object and nothing else."""
_AXIS_POINTS = 41
_FREE = 6
"""The object's degrees of freedom come first; three for each capsule follow."""


@dataclass(frozen=True)
class Fall:
    """How far the object moved (its centre of mass, m) and turned (rad) under gravity."""

    moved_m: float
    turned: float

    @property
    def held(self) -> bool:
        """Whether the hands held it."""
        return bool(self.moved_m < MOVED_M and self.turned < TURNED)


class DropTest:
    """The drop test of one object in one or two hands of one kind. Calls from several threads do not interfere."""

    def __init__(self, shape: Shape, hand: Hand, hands: int = 1) -> None:
        self._shape, self._hand = shape, hand
        self._model = _model(shape, hand, hands)

    def fall(self, joints: Sequence[Array], down: Array) -> Fall:
        """Simulate one frame: the joints `(J, 3)` of each hand and the unit vector `down (3,)` of gravity.

        A finger that enters the object ends there, because a hand stuck in the object would otherwise hold it.
        """
        positions = np.stack(joints)
        here = np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(positions), 1))
        gaps = metrics.capsule_gaps(self._hand, positions, here, self._shape)
        model = copy.copy(self._model)
        self._place(model, metrics.capsule_axes(self._hand, positions), gaps)
        data = mujoco.MjData(model)
        model.opt.gravity[:] = 0.0
        model.dof_damping[:3] = SETTLE_RATE_HZ * OBJECT_KG
        model.dof_damping[3:_FREE] = SETTLE_RATE_HZ * OBJECT_KG * self._shape.inertia.diagonal()
        mujoco.mj_step(model, data, round(SETTLE_S / model.opt.timestep))
        settled = self._center(data), data.qpos[[4, 5, 6, 3]].copy()
        model.opt.gravity[:] = GRAVITY_M_S2 * down
        model.dof_damping[:_FREE] = 0.0
        mujoco.mj_step(model, data, round(FALL_S / model.opt.timestep))
        return self._fall(data, *settled)

    def _place(self, model: mujoco.MjModel, axes: Array, gaps: Gaps) -> None:
        """Put the capsules where they are, or far away if taken out, and press those that touch by their springs."""
        depth = np.maximum(-gaps.gap - OVERLAP_M, 0.0)
        middle = 0.5 * (axes[:, :, 0] + axes[:, :, -1]) + depth[..., None] * gaps.normal
        model.body_pos[2:] = np.where(self._taken_out(axes)[..., None], _AWAY, middle).reshape(-1, 3)
        along = (axes[:, :, -1] - axes[:, :, 0]).reshape(-1, 3)
        for geom, direction in enumerate(along, start=model.ngeom - len(along)):
            mujoco.mju_quatZ2Vec(model.geom_quat[geom], direction)
        touching = gaps.gap < metrics.TOUCH_M
        model.qpos_spring[7:] = (-PRESS_M * touching[..., None] * gaps.normal).ravel()

    def _taken_out(self, axes: Array) -> Mask:
        """The capsules whose axis enters the object, and those beyond them on the same finger, `(hands, C)`.

        No force can reach the latter through the object. The axes are sampled finely, because walls are thin.
        """
        fractions = np.linspace(0.0, 1.0, _AXIS_POINTS)[:, None]
        points = axes[:, :, :1] + fractions * (axes[:, :, -1:] - axes[:, :, :1])
        distance = self._shape.signed_distance(points.reshape(-1, 3))[0]
        out = np.any(distance.reshape(points.shape[:3]) < 0.0, axis=2, keepdims=True)[:, :, 0]
        starts, ends = self._hand.capsules.T
        for capsule, start in enumerate(starts):  # from the palm to the tips
            out[:, capsule] |= out[:, ends == start].any(axis=1)
        return out

    def _center(self, data: mujoco.MjData) -> Array:
        """The centre of mass, `(3,)`."""
        return data.qpos[:3] + geometry.quat_rotate(data.qpos[[4, 5, 6, 3]], self._shape.center_of_mass)

    def _fall(self, data: mujoco.MjData, center: Array, quat: Array) -> Fall:
        turn = geometry.quat_multiply(geometry.quat_conjugate(quat), data.qpos[[4, 5, 6, 3]])
        moved = float(np.linalg.norm(self._center(data) - center))
        return Fall(moved, float(2.0 * np.arccos(min(1.0, abs(turn[3])))))


def _model(shape: Shape, hand: Hand, hands: int) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC  # the default cone lets objects creep
    spec.option.impratio = 10.0
    spec.option.noslip_iterations = 2
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_MULTICCD
    _add_object(spec, shape)
    for length, radius in list(zip(_lengths(hand), hand.radii, strict=True)) * hands:
        _add_capsule(spec, length, radius)
    return spec.compile()


def _add_object(spec: mujoco.MjSpec, shape: Shape) -> None:
    inertia = OBJECT_KG * shape.inertia
    upper = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    body = spec.worldbody.add_body(mass=OBJECT_KG, ipos=shape.center_of_mass, fullinertia=upper, explicitinertial=True)
    body.add_freejoint()
    for k, points in enumerate(shell_pieces(shape.mesh)):
        mesh = spec.add_mesh(name=f"piece{k}", uservert=points.ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=mesh.name,
            friction=[FRICTION, 0.0, 0.0],
            contype=_OBJECT_BIT,
            conaffinity=_HAND_BIT,
        )


def _add_capsule(spec: mujoco.MjSpec, length: float, radius: float) -> None:
    body = spec.worldbody.add_body()
    damping = 2.0 * np.sqrt(SPRING_N_M * CAPSULE_KG)  # critical
    for axis in np.eye(3):
        joint = body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        joint.stiffness[0], joint.damping[0] = SPRING_N_M, damping
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[radius, 0.5 * length, 0.0],
        mass=CAPSULE_KG,
        friction=[FRICTION, 0.0, 0.0],
        contype=_HAND_BIT,
        conaffinity=_OBJECT_BIT,
    )


def _lengths(hand: Hand) -> Array:
    """The length of each capsule's axis `(C,)`, where `metrics.capsule_axes` samples it."""
    bones = np.linalg.norm(hand.offsets[hand.capsules[:, 1]], axis=1)
    return bones * np.where(hand.capsules[:, 0] == 0, 1.0 - metrics.PALM_START, 1.0)
