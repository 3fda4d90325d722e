"""Whether a grasp holds in a simulator (MuJoCo): the fingers press, then gravity pulls one way after the other.

The fingers are chains of hinges with servos. Each servo aims a little beyond the pose, by the torque that balanced
forces at the contacts need: closing all joints a bit instead would move them by degrees. Everything is in the object's
frame, SI units. It needs the extra `generate`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array, matrix_to_quat, quat_conjugate, quat_rotate
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet_tools.generate.contact import PALM_START, Space, look
from manipnet_tools.generate.finger_tables import Tables
from manipnet_tools.generate.forces import squeeze
from manipnet_tools.generate.grasps import TOUCH_M, Grasp
from manipnet_tools.generate.mirrored import Surface

OBJECT_KG: Final = 0.2
FRICTION: Final = 0.8
SQUEEZE_N: Final = 15.0
SERVO_NM_RAD: Final = 6.0
MOST_TORQUE_NM: Final = 1.2
SETTLE_S, SHAKE_S = 0.4, 0.25
STEP_S: Final = 0.002
GRAVITY_M_S2: Final = 9.81
MOVED_M, TURNED_RAD = 0.025, np.radians(45.0)
SETTLED_M: Final = 0.02
"""An object that moves farther than this while the fingers press was not where the grasp said."""
_HAND_BIT, _OBJECT_BIT = 1, 2


@dataclass(frozen=True, eq=False)
class Placed:
    """One hand in the simulator: the pose of its wrist `(7,)` in the object's frame, its angles `(A,)`, and how far
    each servo aims beyond them `(A,)`."""

    pose: Array
    angles: Array
    aims: Array


class Simulation:
    """One object with some hands."""

    def __init__(self, hands: Sequence[Hand], shape: Surface, pieces: Sequence[Array]) -> None:
        self._shape = shape
        self._model = _model(hands, shape, pieces)
        self._data = mujoco.MjData(self._model)
        self._wrists = [self._model.body(_name(k, "wrist")).id for k in range(len(hands))]

    def holds(self, hands: Sequence[Placed], downs: Array) -> bool:
        """Whether the hands hold the object while gravity takes each of the directions `downs (n, 3)`."""
        model, data = self._model, self._data
        mujoco.mj_resetData(model, data)
        for wrist, hand in zip(self._wrists, hands, strict=True):
            model.body_pos[wrist], model.body_quat[wrist] = hand.pose[:3], hand.pose[[6, 3, 4, 5]]
        angles = np.concatenate([hand.angles for hand in hands])
        data.qpos[: len(angles)] = angles
        data.ctrl[:] = angles + np.concatenate([hand.aims for hand in hands])
        model.opt.gravity[:] = 0.0
        free = slice(len(angles), len(angles) + 6)
        model.dof_damping[free] = 100.0 * OBJECT_KG * np.r_[1.0, 1.0, 1.0, self._shape.inertia.diagonal()]
        start = data.qpos[-7:].copy()
        mujoco.mj_step(model, data, round(SETTLE_S / STEP_S))
        if self._moved(start, data.qpos[-7:])[0] > SETTLED_M:
            return False
        model.dof_damping[free] = 0.0
        settled = data.qpos[-7:].copy()
        for down in downs:
            model.opt.gravity[:] = GRAVITY_M_S2 * down
            mujoco.mj_step(model, data, round(SHAKE_S / STEP_S))
            moved, turned = self._moved(settled, data.qpos[-7:])
            if not (moved < MOVED_M and turned < TURNED_RAD):
                return False
        return True

    def _moved(self, before: Array, after: Array) -> tuple[float, float]:
        """How far the centre of mass moved, and how far the object turned."""
        centre = np.zeros(3), np.zeros(3)
        for pose, result in zip((before, after), centre, strict=True):
            mujoco.mju_rotVecQuat(result, self._shape.center_of_mass, pose[3:])
            result += pose[:3]
        turned = 2.0 * np.arccos(min(1.0, abs(float(before[3:] @ after[3:]))))
        return float(np.linalg.norm(centre[1] - centre[0])), turned


class Shaker:
    """Tries grasps of one object by one hand."""

    def __init__(self, tables: Tables, shape: Surface, pieces: Sequence[Array]) -> None:
        self._tables, self._shape = tables, shape
        self._simulation = Simulation([tables.hand], shape, pieces)

    def holds(self, space: Space, grasp: Grasp) -> bool:
        """Whether the grasp holds the object while gravity takes each of its directions."""
        at, points, normals = contacts(self._tables, space, grasp)
        forces = squeeze(points, normals, self._shape.center_of_mass, SQUEEZE_N)
        aims = aims_of(self._tables.hand, grasp, at, points, forces)
        return self._simulation.holds([Placed(pose_of(grasp), grasp.angles, aims)], grasp.downs)


def pose_of(grasp: Grasp) -> Array:
    """The wrist `(7,)` in the object's frame."""
    return np.concatenate([grasp.place, matrix_to_quat(grasp.turn)])


def contacts(tables: Tables, space: Space, grasp: Grasp) -> tuple[NDArray[np.intp], Array, Array]:
    """The capsules that touch `(n,)`, with the points on their axes and the object's normals there, `(n, 3)`."""
    gaps, points, normals, _ = look(space, tables.body, grasp.angles, grasp.turn, grasp.place)
    at = np.flatnonzero(gaps < TOUCH_M)
    return at, points[at], normals[at]


def aims_of(hand: Hand, grasp: Grasp, capsules: NDArray[np.intp], points: Array, forces: Array) -> Array:
    """How far each servo aims beyond the pose `(A,)` to press with `forces (n, 3)`: torque over stiffness."""
    positions, rotations = forward_kinematics(hand, grasp.angles)
    torques = np.zeros(len(grasp.angles))
    for capsule, point, force in zip(capsules.tolist(), points, forces, strict=True):
        if capsule < 4:
            continue
        finger = (capsule - 4) // 3
        local, push = grasp.turn.T @ (point - grasp.place), grasp.turn.T @ force
        for a in range(4 * finger, 4 * finger + 4):
            bone = int(hand.angle_bones[a])
            if bone > hand.capsules[capsule, 0]:
                continue
            axis = rotations[hand.parents[bone]] @ hand.axes[a]
            torques[a] += axis @ np.cross(local - positions[bone], push)
    return np.clip(torques, -MOST_TORQUE_NM, MOST_TORQUE_NM) / SERVO_NM_RAD


def hand_model(hand: Hand) -> mujoco.MjModel:
    """The hand alone, for a look at its kinematics."""
    spec = _spec()
    _add_hand(spec, hand, 0)
    return spec.compile()


def _model(hands: Sequence[Hand], shape: Surface, pieces: Sequence[Array]) -> mujoco.MjModel:
    spec = _spec()
    for number, hand in enumerate(hands):
        _add_hand(spec, hand, number)
    _add_object(spec, shape, pieces)
    return spec.compile()


def _spec() -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    spec.compiler.autolimits = True
    spec.compiler.degree = False
    spec.option.timestep = STEP_S
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC  # the default cone lets objects creep
    spec.option.impratio = 10.0
    spec.option.noslip_iterations = 2
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_MULTICCD
    return spec


def _name(number: int, part: str) -> str:
    """The name of a part of one hand."""
    return f"{part} {number}"


def _add_hand(spec: mujoco.MjSpec, hand: Hand, number: int) -> None:
    bodies = {0: spec.worldbody.add_body(name=_name(number, "wrist"), gravcomp=1.0)}
    for bone in range(1, hand.bone_count):
        bodies[bone] = bodies[int(hand.parents[bone])].add_body(
            name=_name(number, hand.joint_names[bone]),
            pos=hand.offsets[bone],
            quat=hand.rest_quats[bone, [3, 0, 1, 2]],
            gravcomp=1.0,
            mass=0.01,
            inertia=[1e-6] * 3,
            explicitinertial=True,
        )
        for a in np.flatnonzero(hand.angle_bones == bone):
            joint = bodies[bone].add_joint(
                name=_name(number, hand.angle_names[a]),
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=quat_rotate(quat_conjugate(hand.rest_quats[bone]), hand.axes[a]),
                range=hand.limits[a] + [-0.3, 0.3],
            )
            joint.armature = 1e-4
            joint.damping[0] = 0.05
    for c, (start, end) in enumerate(hand.capsules.tolist()):
        first = PALM_START * hand.offsets[end] if start == 0 else np.zeros(3)
        bodies[start].add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=np.concatenate([first, hand.offsets[end]]),
            size=[hand.radii[c], 0.0, 0.0],
            friction=[FRICTION, 0.0, 0.0],
            contype=_HAND_BIT,
            conaffinity=_OBJECT_BIT,
            mass=0.0,
        )
    for angle in hand.angle_names:
        name = _name(number, angle)
        servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.gainprm[0] = SERVO_NM_RAD
        servo.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        servo.biasprm[1] = -SERVO_NM_RAD


def _add_object(spec: mujoco.MjSpec, shape: Surface, pieces: Sequence[Array]) -> None:
    inertia = OBJECT_KG * shape.inertia
    upper = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    body = spec.worldbody.add_body(
        name="object", mass=OBJECT_KG, ipos=shape.center_of_mass, fullinertia=upper, explicitinertial=True
    )
    body.add_freejoint()
    for k, points in enumerate(pieces):
        mesh = spec.add_mesh(name=f"piece{k}", uservert=points.ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=mesh.name,
            friction=[FRICTION, 0.0, 0.0],
            contype=_OBJECT_BIT,
            conaffinity=_HAND_BIT,
            mass=0.0,
        )
