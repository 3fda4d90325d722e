"""How the model's hand looks: its skin with a forearm that fades out, smoother knuckles, and nails.

Only the picture changes: sensors and contacts belong to the skin of the bundle. Everything is made from the hand's own
generated skin, once, in the frame of the right hand's wrist and in the pose of `skin.bind_angles`.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import KDTree

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics

CUT_M: Final = -0.014
"""Where the skin is cut along the wrist's x axis. Behind this it is a round end, which follows the wrist alone."""
SOLID_M: Final = 0.03
"""Length of the forearm that is as solid as the hand."""
FADE_M: Final = 0.1
"""Length over which the rest fades out."""
WIDENS: Final = np.array([1.2, 3.0])
"""How much wider (y) and thicker (z) the forearm becomes, relative to the cut and per metre."""
RINGS: Final = 14
SMOOTH_ROUNDS: Final = 14
KNUCKLE_M: Final = 0.026
"""Skin within this distance of a knuckle follows its bones more gradually."""
NAIL: Final = (0.52, 0.58, 0.12)
"""Width and length of a nail and its distance from the end of the finger, relative to the thickness of the finger."""
NAIL_STEPS: Final = 9
NEAR_TIP_M: Final = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Nails:
    """The nails of a hand: `vertices (V, 3)`, `faces (N, 3)`, and the `bones (V,)` that they follow."""

    vertices: Array
    faces: NDArray[np.int32]
    bones: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class HandLook:
    """The meshes of a right hand: skin, fading forearm and nails."""

    hand: Hand
    vertices: Array
    """`(V, 3)` of the skin with the solid part of the forearm."""
    faces: NDArray[np.int32]
    weights: NDArray[np.float32]
    """`(V, B)`"""
    cuff: tuple[Array, NDArray[np.int32], Array]
    """The fading forearm in the wrist's frame: `vertices (C, 3)`, `faces`, and the opacity `(C,)` of each vertex."""
    nails: Nails


def look_of(hand: Hand) -> HandLook:
    """The look of a hand, made from its skin."""
    weights = _smooth_knuckles(hand, _dense_weights(hand))
    vertices, faces = _cut(hand.skin.vertices, hand.skin.faces)
    kept = _nearest(hand.skin.vertices, vertices)
    weights = weights[kept]
    loop = _boundary(vertices, faces)
    solid, solid_faces = _tube(vertices[loop], 0.0, SOLID_M, 5)
    # the first ring of the tube is the boundary itself, so that the surface is smooth across it
    numbers = np.concatenate([loop, len(vertices) + np.arange(len(solid) - len(loop))])
    of_wrist = np.zeros((len(solid) - len(loop), hand.bone_count), np.float32)
    of_wrist[:, 0] = 1.0
    cuff, cuff_faces = _tube(vertices[loop], SOLID_M - 0.004, FADE_M, RINGS)
    along = np.repeat(np.linspace(0.0, 1.0, RINGS + 1), len(loop))
    return HandLook(
        hand,
        np.concatenate([vertices, solid[len(loop) :]]),
        np.concatenate([faces, numbers[solid_faces]]).astype(np.int32),
        np.concatenate([weights, of_wrist]),
        (cuff, cuff_faces, np.clip(1.0 - along, 0.0, 1.0) ** 1.4),
        _nails(hand),
    )


def _dense_weights(hand: Hand) -> NDArray[np.float32]:
    """The skin's weights for every bone, `(V, B)`."""
    weights = np.zeros((len(hand.skin.vertices), hand.bone_count), np.float32)
    np.add.at(weights, (np.arange(len(weights))[:, None], hand.skin.bones), hand.skin.weights)
    return weights


def _smooth_knuckles(hand: Hand, weights: NDArray[np.float32]) -> NDArray[np.float32]:
    """Weights that change more gradually along the skin around the roots of the four fingers."""
    joints, _ = forward_kinematics(hand, hand.skin.bind_angles)
    roots = joints[[finger[0] for finger in hand.fingers[1:]]]
    away_m = np.linalg.norm(hand.skin.vertices[:, None] - roots, axis=2).min(axis=1)
    share = np.clip(2.0 * (1.0 - away_m / KNUCKLE_M), 0.0, 1.0)[:, None].astype(np.float32)
    edges = np.concatenate([hand.skin.faces[:, [0, 1]], hand.skin.faces[:, [1, 2]], hand.skin.faces[:, [2, 0]]])
    counts = np.bincount(edges.ravel(), minlength=len(weights))[:, None].astype(np.float32)
    for _ in range(SMOOTH_ROUNDS):
        total = np.zeros_like(weights)
        np.add.at(total, edges[:, 0], weights[edges[:, 1]])
        np.add.at(total, edges[:, 1], weights[edges[:, 0]])
        weights = weights + 0.5 * share * (total / counts - weights)
    return weights / weights.sum(axis=1, keepdims=True)


def _cut(vertices: Array, faces: NDArray) -> tuple[Array, NDArray[np.int32]]:
    """The part of a mesh in front of the cut, with a boundary that lies in it."""
    sliced = trimesh.intersections.slice_faces_plane(vertices, faces, (1.0, 0.0, 0.0), (CUT_M, 0.0, 0.0))
    cut = trimesh.Trimesh(*sliced[:2], process=False)
    cut.merge_vertices()
    return np.asarray(cut.vertices), np.asarray(cut.faces, np.int32)


def _nearest(points: Array, places: Array) -> NDArray[np.int64]:
    """For each of the `places`, the number of the nearest point."""
    return np.asarray(KDTree(points).query(places)[1], np.int64)


def _boundary(vertices: Array, faces: NDArray) -> NDArray[np.int64]:
    """The vertices of the boundary, in order around the wrist as seen from the fingers."""
    on_cut = np.flatnonzero(np.abs(vertices[:, 0] - CUT_M) < 1e-9)
    used = np.intersect1d(on_cut, faces)
    y, z = (vertices[used] - vertices[used].mean(axis=0))[:, 1:].T
    return used[np.argsort(np.arctan2(z, y))]


def _tube(loop: Array, begin_m: float, length_m: float, rings: int) -> tuple[Array, NDArray[np.int32]]:
    """A tube from a loop backwards: `rings` + 1 copies of it, wider and wider, and the faces between them."""
    center = loop.mean(axis=0)
    back_m = begin_m + np.linspace(0.0, length_m, rings + 1)
    copies = np.repeat(loop[None], rings + 1, axis=0)
    copies[:, :, 0] -= back_m[:, None]
    copies[:, :, 1:] = center[1:] + (1.0 + back_m[:, None, None] * WIDENS) * (loop - center)[None, :, 1:]
    count = len(loop)
    here = np.arange(rings)[:, None] * count + np.arange(count)
    beside = np.arange(rings)[:, None] * count + (np.arange(count) + 1) % count
    quads = np.stack([here, beside, beside + count, here + count], axis=-1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 2, 1]], quads[:, [0, 3, 2]]]).astype(np.int32)
    return copies.reshape(-1, 3), faces


def _nails(hand: Hand) -> Nails:
    """A nail on the back of each fingertip: a curved plate that lies on the skin, with its edges just below it."""
    joints, rotations = forward_kinematics(hand, hand.skin.bind_angles)
    skin = trimesh.Trimesh(hand.skin.vertices, hand.skin.faces, process=False)
    vertices, faces, bones = [], [], []
    for finger in hand.fingers:
        bone, tip = finger[-2], joints[finger[-1]]
        angle = int(np.flatnonzero(hand.angle_bones == bone)[-1])
        along = (tip - joints[bone]) / np.linalg.norm(tip - joints[bone])
        axis = rotations[hand.parents[bone]] @ hand.axes[angle]
        back = -np.cross(axis, along)
        back /= np.linalg.norm(back)
        tries = (_plate(skin, tip, along, back, size) for size in (1.0, 0.85, 0.7, 0.55))
        patch = next((patch for patch in tries if patch is not None), None)
        if patch is not None:
            faces.append(_grid_faces(NAIL_STEPS) + sum(len(each) for each in vertices))
            vertices.append(patch)
            bones.append(np.full(len(patch), bone))
    if not vertices:
        return Nails(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros(0, np.int64))
    return Nails(np.concatenate(vertices), np.concatenate(faces), np.concatenate(bones))


def _plate(skin: trimesh.Trimesh, tip: Array, along: Array, back: Array, size: float) -> Array | None:
    """The grid of a nail, or None if not all of it lies on the skin."""
    across = np.cross(back, along)
    radius = _thickness_m(skin, tip, along, back)
    width, length, before = (size * share * radius * 2.0 for share in NAIL)
    s, t = np.meshgrid(np.linspace(-1.0, 1.0, NAIL_STEPS), np.linspace(-1.0, 1.0, NAIL_STEPS), indexing="ij")
    # a square whose corners are round
    u, v = s * np.sqrt(1.0 - 0.32 * t**2), t * np.sqrt(1.0 - 0.32 * s**2)
    near = skin.vertices[np.linalg.norm(skin.vertices - tip, axis=1) < NEAR_TIP_M]
    end_m = float(((near - tip) @ along).max())
    middle = tip + (end_m - before - 0.5 * length) * along
    points = middle + 0.5 * width * u[..., None] * across + 0.5 * length * v[..., None] * along
    origins = (points + 0.03 * back).reshape(-1, 3)
    hits, rays, _ = skin.ray.intersects_location(origins, np.tile(-back, (len(origins), 1)), multiple_hits=False)
    if len(rays) != len(origins):
        return None
    placed = np.empty_like(origins)
    placed[rays] = hits
    edge = np.maximum(np.abs(s), np.abs(t)).ravel()
    return placed + np.where(edge > 0.99, -0.0004, 0.00045 - 0.0003 * edge**2)[:, None] * back


def _thickness_m(skin: trimesh.Trimesh, tip: Array, along: Array, back: Array) -> float:
    """Half the thickness of the finger a little before its tip."""
    origin = tip - 0.004 * along
    hits, *_ = skin.ray.intersects_location([origin + 0.03 * back], [-back], multiple_hits=False)
    return float(np.linalg.norm(hits[0] - origin)) if len(hits) else 0.007


def _grid_faces(steps: int) -> NDArray[np.int32]:
    """The faces of a grid, seen from the back of the finger."""
    row, column = np.meshgrid(np.arange(steps - 1), np.arange(steps - 1), indexing="ij")
    corner = (row * steps + column).ravel()
    quads = np.stack([corner, corner + steps, corner + steps + 1, corner + 1], axis=1)
    return np.concatenate([quads[:, [0, 2, 1]], quads[:, [0, 3, 2]]]).astype(np.int32)
