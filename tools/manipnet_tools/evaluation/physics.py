"""Whether the hands' contacts explain how the object moves: the paper's appendix A, by non-negative least squares.

Everything is in the object's own axes, in SI units, for a mass of 1 kg. A contact may push with any non-negative mix of
the four edges of its friction cone. The pushes must add up to the object's acceleration minus gravity, and their
torques about the centre of mass to its change of angular momentum.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.signal import savgol_filter
from scipy.spatial import ConvexHull

from manipnet import geometry
from manipnet.geometry import Array
from manipnet.synthesis.objects.shape import Shape
from manipnet.tracking.tick import TICK_HZ
from manipnet_tools.evaluation.metrics import Gaps, Mask

GRAVITY_M_S2 = 9.81
FRICTION = 0.35
LIFTED_M = 0.02


@dataclass(frozen=True)
class Rule:
    """What counts as a contact, and as explained.

    Capsules with a gap below `contact_m` push. Torques are divided by `lever_m` so that they weigh like forces.
    Derivatives come from a cubic fitted over `fit_frames` (3: plain finite differences). Motion is explained if the
    remainder is below `tolerance_m_s2`.
    """

    contact_m: float
    lever_m: float
    tolerance_m_s2: float
    fit_frames: int


RULE = Rule(contact_m=0.004, lever_m=0.05, tolerance_m_s2=0.1 * GRAVITY_M_S2, fit_frames=15)
PAPER = Rule(contact_m=0.0, lever_m=1.0, tolerance_m_s2=0.01, fit_frames=3)
"""Appendix A to the letter: colliders must overlap, and almost nothing may remain unexplained."""


@dataclass(frozen=True)
class Body:
    """An object of mass 1 kg in its mesh frame: centre of mass (3,), inertia about it (3, 3), hull (n, 3)."""

    center_of_mass: Array
    inertia: Array
    vertices: Array


def body_of(shape: Shape) -> Body:
    """The shape as a solid of uniform density."""
    vertices = shape.mesh.vertices
    return Body(shape.center_of_mass, shape.inertia, vertices[ConvexHull(vertices).vertices])


def lifted(T_world_object: Array, body: Body) -> Mask:
    """Frames whose lowest point is more than 2 cm above the lowest of the whole take, `(T, 7)` to `(T,)`."""
    up = geometry.quat_rotate(geometry.quat_conjugate(T_world_object[:, 3:]), np.array([0.0, 1.0, 0.0]))
    lowest = T_world_object[:, 1] + (up @ body.vertices.T).min(axis=1)
    return lowest > lowest.min() + LIFTED_M


def wrench_needed(T_world_object: Array, body: Body, rule: Rule = RULE) -> Array:
    """Force and torque / lever the contacts must supply, `(T, 7)` to `(T, 6)`, object axes, m/s²."""
    quats = geometry.continuous_quats(T_world_object[:, 3:])
    q_inverse = geometry.quat_conjugate(geometry.quat_normalize(_derivative(quats, 0, rule)))
    # In body axes q' = q w / 2, so w = 2 q* q'; differentiating once more leaves the vector part of 2 q* q''.
    velocity = 2.0 * geometry.quat_multiply(q_inverse, _derivative(quats, 1, rule))[:, :3]
    acceleration = 2.0 * geometry.quat_multiply(q_inverse, _derivative(quats, 2, rule))[:, :3]
    torque = acceleration @ body.inertia + np.cross(velocity, velocity @ body.inertia)
    center = geometry.transform(T_world_object, body.center_of_mass)
    support = _derivative(center, 2, rule) + np.array([0.0, GRAVITY_M_S2, 0.0])
    return np.concatenate([geometry.quat_rotate(q_inverse, support), torque / rule.lever_m], axis=1)


def _derivative(values: Array, order: int, rule: Rule) -> Array:
    degree = min(3, rule.fit_frames - 1)
    fitted = savgol_filter(values, rule.fit_frames, degree, deriv=order, delta=1.0 / TICK_HZ, axis=0)
    return np.asarray(fitted, dtype=np.float64)


def cone_wrenches(point: Array, normal: Array, body: Body, rule: Rule = RULE) -> Array:
    """Wrenches of the four cone edges of contacts: points and normals `(n, 3)` to columns `(6, 4 n)`."""
    tangent = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)]).astype(np.float64)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = np.cross(normal, tangent).astype(np.float64)
    sides = np.stack([tangent, -tangent, bitangent, -bitangent], axis=1)
    force = (FRICTION * sides - normal[:, None]).reshape(-1, 3)
    arm = np.repeat(point - body.center_of_mass, 4, axis=0)
    return np.concatenate([force, np.cross(arm, force) / rule.lever_m], axis=1).T


def residuals(hands: list[Gaps], wrench: Array, body: Body, rule: Rule = RULE) -> Array:
    """The part of `wrench (T, 6)` that the contacts of all hands together leave unexplained, m/s², `(T,)`."""
    gap = np.concatenate([hand.gap for hand in hands], axis=1)
    point = np.concatenate([hand.point for hand in hands], axis=1)
    normal = np.concatenate([hand.normal for hand in hands], axis=1)
    touching = gap < rule.contact_m
    out = np.linalg.norm(wrench, axis=1)
    for frame in np.flatnonzero(touching.any(axis=1)):
        which = touching[frame]
        out[frame] = nnls(cone_wrenches(point[frame, which], normal[frame, which], body, rule), wrench[frame])[1]
    return out


def explained_share(residual: Array, frames: Mask, rule: Rule = RULE) -> float:
    """Share of the masked frames whose motion the contacts explain; nan if the mask is empty."""
    return float((residual[frames] < rule.tolerance_m_s2).mean()) if frames.any() else float("nan")
