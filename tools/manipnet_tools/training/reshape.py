"""Captured grasps on stretched objects: more shapes to learn from than were ever captured.

The object is stretched about its centre of mass; each hand moves along with the surface it touches, and its fingers are
solved again so that the joints keep their distance to the new surface.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from manipnet.geometry import MIRROR, Array, quat_rotate, quat_to_matrix
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.ik.least_squares import solve_least_squares
from manipnet.synthesis.objects.mesh import closed_mesh
from manipnet.synthesis.objects.shape import Shape, build_shape
from manipnet.synthesis.sensing.scene import object_from_wrist
from manipnet_tools.training.dataset import HandTrack

_REACH_M = 0.03
"""Joints farther from the surface than this hardly follow it."""
_WRIST_SMOOTHING = 8.0
_FINGER_SMOOTHING = 4.0
"""Standard deviations of the smoothing over time, frames at 120 Hz."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """A symmetric linear map `(3, 3)` about a centre `(3,)`, in the object's frame."""

    matrix: Array
    center: Array

    def points(self, p: Array) -> Array:
        """Where points `(..., 3)` go."""
        return self.center + (p - self.center) @ self.matrix

    def normals(self, n: Array) -> Array:
        """Where surface normals `(..., 3)` turn."""
        turned = n @ np.linalg.inv(self.matrix)
        return turned / np.linalg.norm(turned, axis=-1, keepdims=True)


def random_stretch(shape: Shape, rng: np.random.Generator, amount: float = 0.25) -> Stretch:
    """Stretches by up to `exp(±amount)` along three random perpendicular directions."""
    turn = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    return Stretch(turn @ np.diag(np.exp(rng.uniform(-amount, amount, 3))) @ turn.T, shape.center_of_mass)


def stretched_shape(shape: Shape, stretch: Stretch) -> Shape:
    """The stretched object."""
    return build_shape(closed_mesh(stretch.points(shape.mesh.vertices), shape.mesh.faces, shape.name))


def reshape_take(hands: tuple[HandTrack, HandTrack], stretch: Stretch) -> tuple[HandTrack, HandTrack]:
    """Both hands of a take, holding the stretched object instead."""
    shape = stretched_shape(hands[0].shape, stretch)
    moves = [_moves(hand, stretch) for hand in hands]
    reshaped = []
    for k, (hand, (targets, shift)) in enumerate(zip(hands, moves, strict=True)):
        other_shift = moves[1 - k][1] * np.array([-1.0, 1.0, 1.0])  # the other track is the mirrored scene
        wrist = hand.wrist.copy()
        wrist[:, :3] += shift
        moved = replace(hand, shape=shape, wrist=wrist, other_wrist=hand.other_wrist + other_shift)
        reshaped.append(replace(moved, angles=_solve(moved, targets)))
    return reshaped[0], reshaped[1]


def _moves(hand: HandTrack, stretch: Stretch) -> tuple[Array, Array]:
    """Where the joints `(T, 22, 3)` should be in the scene, and how far the wrist moves `(T, 3)`."""
    flip = MIRROR if hand.mirrored else np.eye(3)
    turn = quat_to_matrix(hand.object[:, 3:])
    world = hand.wrist[:, None, :3] + quat_rotate(hand.wrist[:, None, 3:], forward_kinematics(hand.angles)[0])
    p = np.einsum("tij,tkj->tki", np.swapaxes(turn, 1, 2), world - hand.object[:, None, :3]) @ flip
    distance, normal, closest = (v.reshape(*p.shape[:2], -1) for v in hand.shape.signed_distance(p.reshape(-1, 3)))
    follow = np.exp(-((np.maximum(distance, 0.0) / _REACH_M) ** 2))
    ahead = stretch.points(closest) + distance * stretch.normals(normal) - p
    weight = follow[:, 1:]
    shift = np.sum(weight * ahead[:, 1:], axis=1) / (weight.sum(axis=1) + 0.3)
    shift = gaussian_filter1d(shift, _WRIST_SMOOTHING, axis=0)
    moved = p + follow * ahead + (1.0 - follow) * shift[:, None]
    back = np.einsum("tij,tkj->tki", turn, moved @ flip) + hand.object[:, None, :3]
    return back, np.einsum("tij,tj->ti", turn, shift @ flip)


def _solve(hand: HandTrack, targets: Array) -> Array:
    limits = np.stack([hand.angles.min(axis=0) - 0.1, hand.angles.max(axis=0) + 0.1], axis=1)
    solved = hand.angles.copy()
    _solve_frames(solved, targets, hand.wrist, hand.object, hand.mirrored, limits, hand.shape.field)
    return hand.angles + gaussian_filter1d(solved - hand.angles, _FINGER_SMOOTHING, axis=0)


@njit(cache=True, nogil=True, error_model="numpy")
def _solve_frames(angles, targets, wrist, obj, mirrored, limits, field):
    rotation, translation = np.empty((3, 3)), np.empty(3)
    local, identity = np.empty((22, 3)), np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    to_wrist, origin = np.empty((3, 3)), np.empty(3)
    apart = np.full(22, 1.0)  # no joint is said to be in contact: targets alone decide
    for t in range(len(angles)):
        object_from_wrist(wrist[t], obj[t], mirrored, rotation, translation)
        # the map from the world to the wrist is the one to an object there
        object_from_wrist(identity, wrist[t], False, to_wrist, origin)
        for j in range(22):
            local[j] = to_wrist @ targets[t, j] + origin
        for _ in range(2):
            start = angles[t].copy()
            solve_least_squares(start, local, apart, 0.0, limits, field, rotation, translation, 1.0, angles[t])
