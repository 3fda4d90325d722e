"""Sensors against brute force on a sphere and a cube, and features against an independent slow version."""

import itertools

import numpy as np
import pytest
import trimesh

from manipnet import geometry as g
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.features import Windows, features, joint_distances
from manipnet.synthesis.model.layout import PRESENT, SENSED, WINDOW_OFFSETS_S, layout_of
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.mesh import closed_mesh
from manipnet.synthesis.objects.shape import build_shape
from manipnet.synthesis.sensing.ambient import CELL_M

HAND = shipped_hand()
LAYOUT = layout_of(HAND)

RADIUS, HALF = 0.04, 0.035
OFF_CENTER = np.array([0.01, -0.02, 0.015])


def sphere_distance(p):
    return np.linalg.norm(p - OFF_CENTER, axis=-1) - RADIUS


def cube_distance(p):
    q = np.abs(p - OFF_CENTER) - HALF
    return np.linalg.norm(np.maximum(q, 0.0), axis=-1) + np.minimum(q.max(axis=-1), 0.0)


@pytest.fixture(scope="module", params=["sphere", "cube"])
def body(request, tmp_path_factory):
    if request.param == "sphere":
        mesh, distance = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS), sphere_distance
    else:
        mesh, distance = trimesh.creation.box([2 * HALF] * 3), cube_distance
    closed = closed_mesh(mesh.vertices + OFF_CENTER, mesh.faces, request.param)
    return build_shape(closed, tmp_path_factory.mktemp("cache")), distance


def smooth_window(rng, center, spread):
    """A window of a body that drifts and turns steadily."""
    velocity, spin = rng.normal(0, spread, 3), rng.normal(0, 0.5, 3)
    start = rng.normal(size=4)
    start /= np.linalg.norm(start)
    return np.stack(
        [
            np.concatenate([center + velocity * t, g.quat_multiply(g.quat_exp(spin * t), start)])
            for t in WINDOW_OFFSETS_S
        ]
    )


@pytest.fixture(scope="module")
def hands():
    """Four hands near the object, two of them left, with random poses."""
    rng = np.random.default_rng(3)
    wrist = np.stack([smooth_window(rng, np.array([0.4, 1.0, -0.2]), 0.1) for _ in range(4)])
    obj = np.empty_like(wrist)
    for n in range(4):
        follow = np.concatenate([[0.1, 0.0, -0.05], [0, 0, 0, 1.0]])
        obj[n] = g.compose(wrist[n], follow)
        obj[n, :, 3:] = smooth_window(rng, np.zeros(3), 0.1)[:, 3:]
    low, high = HAND.limits.T
    poses = forward_kinematics(HAND, rng.uniform(low, high, (4, 20)))
    mirrored = np.array([False, True, False, True])
    other = wrist[:, :, :3] + np.array([0.2, 0.0, 0.1])
    return Windows(wrist, other, obj, mirrored, np.array([1.0, 1.0, 1.3, 0.8])), *poses


def slow_features(shape, distance_of, windows, positions, rotations, n):
    """The paper's section 5 and 6.1, written for clarity from the same conventions."""
    flip = g.MIRROR if windows.mirrored[n] else np.eye(3)
    scale, row = windows.scale[n], {}
    W = g.quat_to_matrix(windows.wrist[n, :, 3:])
    turn = g.quat_to_matrix(windows.object[n, :, 3:])
    R0, p0 = W[PRESENT], windows.wrist[n, PRESENT, :3]
    axes = np.concatenate([rotations[n], rotations[n][HAND.parents[17:]]])
    row["joint_positions"], row["joint_axes"] = positions[n], np.moveaxis(axes[..., :2], -1, -2)
    row["wrist_positions"] = (windows.wrist[n, :, :3] - p0) @ R0
    row["wrist_axes"] = np.moveaxis((R0.T @ W)[..., :2], -1, -2)
    row["other_wrist_distances"] = np.linalg.norm(windows.other_wrist[n] - p0, axis=1)
    center = windows.object[n, :, :3] + scale * (turn @ flip @ shape.center_of_mass)
    row["object_centers"] = (center - p0) @ R0
    q = windows.object[n, :, 3:]
    turns = g.quat_log(g.quat_multiply(q[1:], g.quat_conjugate(q[:-1]))) / 0.05
    row["object_angular_velocities"] = np.concatenate([turns[:1], turns]) @ R0

    def to_object(points, t):
        world = points @ W[t].T + windows.wrist[n, t, :3]
        return (world - windows.object[n, t, :3]) @ turn[t] @ flip / scale

    steps = (np.arange(10) - 4.5) * CELL_M
    cells = HAND.sensors.grid_center + np.array(list(itertools.product(steps, steps, steps)))
    d = scale * distance_of(to_object(cells, PRESENT))
    meets = d < 0.5 * CELL_M
    fine = (np.array(list(itertools.product(np.linspace(-0.5, 0.5, 13), repeat=3)))) * CELL_M
    for cell in np.flatnonzero((d >= 0.5 * CELL_M) & (d < np.sqrt(0.75) * CELL_M)):
        meets[cell] = np.any(distance_of(to_object(cells[cell] + fine, PRESENT)) <= 0.0)
    row["ambient"] = np.where(meets, 1.0 - np.maximum(d, 0.0) / CELL_M, 0.0)

    bones, weights = HAND.sensors.bones, HAND.sensors.weights[..., None]
    points = positions[n][bones] + np.einsum("skij,skj->ski", rotations[n][bones], HAND.sensors.points)
    normals = np.einsum("skij,skj->ski", rotations[n][bones], HAND.sensors.normals)
    points, normals = np.sum(weights * points, axis=1), np.sum(weights * normals, axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    row["proximity"], row["signed_distances"] = np.empty((6, 104)), np.empty((6, 22))
    for i, t in enumerate(SENSED):
        origin, tip = to_object(points, t), to_object(points + normals, t)
        along = (tip - origin) * scale
        inside = distance_of(origin) < 0.0
        hit = scale * shape.trace(origin, np.where(inside[:, None], -along, along))
        row["proximity"][i] = np.where(inside, -1.0, 1.0) * np.minimum(hit, 0.1)
        row["signed_distances"][i] = np.minimum(scale * distance_of(to_object(positions[n], t)), 0.1)
    nudge = 1e-6 * np.eye(3)
    slope = [
        distance_of(to_object(positions[n] + h, PRESENT)) - distance_of(to_object(positions[n] - h, PRESENT))
        for h in nudge
    ]
    slope = np.stack(slope, axis=1)
    row["surface_normals"] = slope / np.linalg.norm(slope, axis=1, keepdims=True)
    return row


def test_sizes_are_those_of_the_paper():
    assert (LAYOUT.input_size, LAYOUT.output_size) == (2356, 220)


def test_features_agree_with_the_slow_version(body, hands):
    shape, distance_of = body
    windows, positions, rotations = hands
    rows = features(HAND, shape, windows, positions, rotations)
    tolerance = {"signed_distances": 1.2e-3, "surface_normals": 8e-2, "proximity": 3e-4}
    for n in range(len(rows)):
        slow = slow_features(shape, distance_of, windows, positions, rotations, n)
        for name, block in LAYOUT.input.items():
            fast = rows[n, block.columns].reshape(block.shape)
            expected = np.reshape(slow[name], block.shape)
            if name == "ambient":
                # the field rounds a cube's edges, so a few cells that barely touch may differ
                assert np.mean(np.abs(fast - expected) > 0.03) < 0.03
                assert np.corrcoef(fast.ravel(), expected.ravel())[0, 1] > 0.98
            elif name == "surface_normals":
                # a joint near an inner ridge of the distance has no one direction
                assert np.mean(np.linalg.norm(fast - expected, axis=-1) > tolerance[name]) < 0.1
            elif name == "proximity":
                # rays that graze an edge aside
                assert np.mean(np.abs(fast - expected) > tolerance[name]) < 0.01
            else:
                np.testing.assert_allclose(fast, expected, atol=tolerance.get(name, 2e-6), err_msg=name)


@pytest.mark.slow
def test_a_left_hand_in_the_mirrored_scene_is_a_right_hand(body, hands, tmp_path):
    """The same scene, its object built as a mirrored mesh instead of being mirrored by the kernels."""
    shape, _ = body
    windows, positions, rotations = hands
    turned = closed_mesh(g.mirror_points(shape.mesh.vertices), shape.mesh.faces[:, ::-1], "mirrored")
    left = Windows(*(v[[1, 3]] for v in windows))
    as_right = left._replace(mirrored=np.zeros(2, bool))
    poses = positions[[1, 3]], rotations[[1, 3]]
    rows = features(HAND, shape, left, *poses)
    expected = features(HAND, build_shape(turned, tmp_path), as_right, *poses)
    rays = np.zeros(LAYOUT.input_size, bool)
    rays[LAYOUT.input["proximity"].columns] = True
    assert np.mean(np.abs(rows - expected)[:, rays] > 1e-5) < 0.01
    # the two fields' grids are not mirror images of one another, so looked-up values differ a little
    assert np.mean(np.abs(rows - expected)[:, ~rays] > 2e-3) < 0.01


def test_joint_distances_are_exact(body, hands):
    shape, distance_of = body
    windows, positions, _ = hands
    distances = joint_distances(shape, windows, positions)
    for n, flip in ((0, np.eye(3)), (1, g.MIRROR)):
        T = windows.wrist[n, PRESENT], windows.object[n, PRESENT]
        p = g.transform(g.invert(T[1]), g.transform(T[0], positions[n])) @ flip
        np.testing.assert_allclose(distances[n], np.minimum(distance_of(p), 0.1), atol=1e-4)
