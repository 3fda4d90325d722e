"""Grips: a hand that carries an object closes until the contacts carry it, by the rule of the evaluation's physics."""

import numpy as np
import pytest
import trimesh
from compiled import call

from manipnet.geometry import Side, compose, invert, quat_exp, quat_rotate, transform
from manipnet.jit import kernel
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.ik.chains import Surface
from manipnet.synthesis.ik.contacts import EDGES, FRICTION, LEVER_M, add_wrenches, find_contact
from manipnet.synthesis.ik.finger_poses import MOST_POSES, touching_poses
from manipnet.synthesis.ik.grip import (
    ANCHOR,
    ease_fingers,
    grip_size,
    loosen_anchor,
    move_anchor,
    move_finger,
    take_pose,
    unpack_grip,
)
from manipnet.synthesis.ik.holders import Hands
from manipnet.synthesis.ik.holding import improve_grips
from manipnet.synthesis.model.features import Windows
from manipnet.synthesis.model.layout import PRESENT
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.mesh import closed_mesh
from manipnet.synthesis.objects.shape import build_shape
from manipnet.synthesis.synthesizer import HandScene, windows_of
from manipnet_tools.evaluation import metrics, physics

HAND = shipped_hand()
OPEN = np.tile([0.15, 0.0, 0.25, 0.15], 5)
OPEN[:4] = 0.0
GRIP = grip_size(5, 20)
PALM_DOWN = quat_exp(np.array([-np.pi / 2, 0.0, 0.0]))
BAR = np.array([0.115, 0.0, -0.046, 0.0, 0.0, 0.0, 1.0])
"""Where the bar is in the wrist frame of a right hand: across the fingers, just below the palm."""


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    """A bar along y, 16 cm long and 4 cm thick."""
    turned = trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0])
    mesh = trimesh.creation.cylinder(radius=0.02, height=0.16, sections=48, transform=turned)
    return build_shape(closed_mesh(mesh.vertices, mesh.faces, "bar"), tmp_path_factory.mktemp("cache"))


def scene(shape, speed_m_s, side: Side = "right", bar_moves=True, height_m=1.0):
    """A hand with the palm down that moves along x at a constant speed, with the bar in it or at rest below it."""
    offsets = np.linspace(-0.5, 0.5, 21)
    wrist = np.stack([np.concatenate([[speed_m_s * t, height_m, 0.0], PALM_DOWN]) for t in offsets])
    if side == "left":
        wrist = wrist * [-1, 1, 1, 1, -1, -1, 1]
    signs = np.array([-1, 1, 1, 1, -1, -1, 1]) if side == "left" else np.ones(7)
    held = compose(wrist, np.tile(BAR * signs, (21, 1)))
    other = wrist + np.array([0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    return HandScene(side, wrist, other, held if bar_moves else np.tile(held[PRESENT], (21, 1)), shape)


@kernel
def improve(skeleton, chains, limits, solid, windows: Windows, count, predicted, angles, distances, grips):
    improve_grips(Hands(skeleton, chains, limits, solid, windows, 0, count, predicted, angles, distances, grips))


def posed(network, grips):
    """The angles `(N, A)` of fingers that do what their grips say."""
    offsets = np.stack([unpack_grip.py_func(row, 5).offsets for row in grips])
    return np.clip(network + offsets, *HAND.limits.T)


def run(scenes, ticks, predicted=OPEN, distances=None, grips=None):
    """The angles `(N, A)` after some ticks, if fingers do what their grips say; `grips (N, G)` go on if given."""
    count = len(scenes)
    windows, grips = windows_of(scenes), np.zeros((count, GRIP)) if grips is None else grips
    network, hand = np.tile(predicted, (count, 1)), (HAND.skeleton, HAND.chains, HAND.limits)
    distances = np.full((count, 22), 0.012) if distances is None else distances
    angles = posed(network, grips)
    for _ in range(ticks):
        improve(*hand, scenes[0].shape.solid, windows, count, network, angles, distances, grips)
        angles = posed(network, grips)
    return angles, grips


def unexplained_weight(scenes, angles):
    """What the contacts leave of the weight by the rule of the evaluation, m/s²."""
    T_world_object, gaps = scenes[0].object[PRESENT], []
    for one, row in zip(scenes, angles, strict=True):
        positions = forward_kinematics(HAND, row)[0]
        if one.side == "left":
            positions = positions * [-1, 1, 1]
        world = transform(one.wrist[PRESENT], positions)
        gaps.append(metrics.capsule_gaps(HAND, world[None], T_world_object[None], scenes[0].shape))
    up = quat_rotate(invert(T_world_object)[3:], np.array([0.0, physics.GRAVITY_M_S2, 0.0]))
    needed = np.concatenate([up, np.zeros(3)])[None]
    return physics.residuals(gaps, needed, physics.body_of(scenes[0].shape))[0]


@pytest.mark.parametrize("side", ["right", "left"])
def test_an_open_hand_closes_until_it_carries_what_moves_with_it(bar, side):
    scenes = [scene(bar, 0.3, side)]
    assert unexplained_weight(scenes, [OPEN]) > 5.0, "the open hand would drop it"
    angles, _ = run(scenes, 90)
    assert unexplained_weight(scenes, angles) < physics.RULE.tolerance_m_s2


def test_both_hands_mirror_each_other(bar):
    right, left = (run([scene(bar, 0.3, side)], 60)[0] for side in ("right", "left"))
    np.testing.assert_allclose(right, left, atol=1e-6)


def test_an_object_at_rest_is_not_gripped(bar):
    angles, grips = run([scene(bar, 0.0)], 60)
    np.testing.assert_array_equal(angles[0], OPEN)
    assert not unpack_grip.py_func(grips[0], 5).ages.any()


@pytest.mark.parametrize("side", ["right", "left"])
def test_an_object_is_gripped_when_it_leaves_the_place_where_it_lay(bar, side):
    _, grips = run([scene(bar, 0.0, side, height_m=1.0)], 3)
    angles, _ = run([scene(bar, 0.3, side, height_m=1.005)], 60, grips=grips)
    np.testing.assert_array_equal(angles[0], OPEN, err_msg="something else carries it, it is only pushed")
    for height_m in (1.02, 0.98):
        lifted = [scene(bar, 0.3, side, height_m=height_m)]
        angles, _ = run(lifted, 90, grips=grips.copy())
        assert unexplained_weight(lifted, angles) < physics.RULE.tolerance_m_s2


def test_an_object_that_is_held_still_does_not_lie_and_the_hold_comes_to_rest(bar):
    moving, still = [scene(bar, 0.3)], [scene(bar, 0.0)]
    _, grips = run(moving, 20)
    distances, unpack = np.full((1, 22), 0.010), unpack_grip.py_func
    run(still, 400, grips=grips, distances=distances)
    before = unpack(grips[0], 5).ages.copy()
    angles, _ = run(still, 100, grips=grips, distances=distances)
    np.testing.assert_array_equal(unpack(grips[0], 5).ages[before > 0.0], before[before > 0.0] + 100)
    assert unexplained_weight(still, angles) < physics.RULE.tolerance_m_s2


def test_an_object_that_stays_behind_is_not_gripped(bar):
    angles, _ = run([scene(bar, 0.4, bar_moves=False)], 60)
    np.testing.assert_array_equal(angles[0], OPEN)


def test_a_grip_that_carries_is_left_alone(bar):
    scenes = [scene(bar, 0.3)]
    closed = run(scenes, 90)[0][0]
    angles, grips = run(scenes, 60, predicted=closed)
    np.testing.assert_array_equal(angles[0], closed)
    assert not unpack_grip.py_func(grips[0], 5).ages.any()


def test_a_hand_that_lets_go_gets_its_fingers_back(bar):
    scenes = [scene(bar, 0.3)]
    closed, grips = run(scenes, 90)
    assert np.abs(closed[0] - OPEN).max() > 0.1
    windows, away = windows_of([scene(bar, 0.0)]), np.full((1, 22), 0.035)
    for _ in range(60):
        hand = HAND.skeleton, HAND.chains, HAND.limits
        improve(*hand, bar.solid, windows, 1, OPEN[None], closed, away, grips)
    grip = unpack_grip.py_func(grips[0], 5)
    assert grip.hand[0] == 0.0
    assert np.abs(grip.offsets).max() < 1e-3
    assert not grip.anchors[::ANCHOR].any()


def test_a_contact_is_where_the_exact_distance_says(bar):
    positions = forward_kinematics(HAND, OPEN)[0]
    surface, out = Surface(bar.field, np.eye(3), -BAR[:3], 1.0), np.empty(7)
    for capsule, (start, end) in enumerate(HAND.capsules):
        first = 0.3 if start == 0 else 0.0
        along = np.linspace(first, 1.0, 7)[:, None]
        axis = positions[start] + along * (positions[end] - positions[start])
        distance, normal, point = bar.signed_distance(axis - BAR[:3])
        nearest = distance.argmin()
        call(find_contact, HAND.chains, capsule, positions, surface, bar.solid, out)
        if out[0] < 0.010:
            assert out[0] == pytest.approx(distance[nearest] - HAND.radii[capsule], abs=2e-4)
            np.testing.assert_allclose(out[1:4], point[nearest], atol=3e-3)
            np.testing.assert_allclose(out[4:], normal[nearest], atol=0.1)


def test_wrenches_are_the_edges_of_the_friction_cone():
    normal = np.array([0.6, 0.0, -0.8])
    contact = np.concatenate([[-0.001], [0.03, 0.01, 0.02], normal])
    center, columns = np.array([0.01, 0.0, 0.0]), np.zeros((8, 6))
    assert call(add_wrenches, contact, center, 2.0, columns, 2) == 2 + EDGES
    force, torque = columns[2:6, :3], columns[2:6, 3:]
    np.testing.assert_allclose(force @ normal, -1.0)
    np.testing.assert_allclose(np.linalg.norm(force + normal, axis=1), FRICTION)
    np.testing.assert_allclose(force.sum(axis=0), -4.0 * normal, atol=1e-12)
    np.testing.assert_allclose(torque, np.cross(2.0 * (contact[1:4] - center), force) / LEVER_M)
    assert not columns[:2].any()


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize("finger", range(5))
def test_poses_found_touch_the_object_and_are_sorted(bar, finger, wide):
    angles = OPEN.copy()
    positions, rotations = (a.copy() for a in forward_kinematics(HAND, angles))
    surface = Surface(bar.field, np.eye(3), -BAR[:3], 1.0)
    costs, poses, axes = np.empty(MOST_POSES), np.empty((MOST_POSES, 4)), np.empty((20, 3))
    hand = HAND.skeleton, HAND.chains, HAND.limits
    posed = angles, positions, rotations, axes
    found = call(touching_poses, *hand, surface, finger, wide, OPEN, *posed, costs, poses)
    if wide and finger < 4:
        assert found > 0, "the bar is within reach of the finger's whole range"
    assert np.all(np.diff(costs[:found]) >= 0.0)
    for pose in poses[:found]:
        bent = OPEN.copy()
        bent[HAND.chains.angles[finger]] = pose
        assert np.all(np.abs(bent - np.clip(bent, *HAND.limits.T)) < 1e-9)
        joints = forward_kinematics(HAND, bent)[0]
        gaps = metrics.capsule_gaps(HAND, joints[None], BAR[None], bar).gap[0]
        assert -0.005 < gaps[HAND.chains.capsules[finger][HAND.chains.capsules[finger] >= 0]].min() < 0.005


def test_a_finger_goes_to_its_pose_without_overshoot_or_jolt():
    numbers, predicted = np.zeros(GRIP), np.zeros(20)
    grip = unpack_grip.py_func(numbers, 5)
    call(take_pose, HAND.chains, 1, np.array([0.5, 0.1, 0.6, 0.3]), grip)
    path = []
    for _ in range(60):
        call(move_finger, HAND.chains, 1, predicted, grip)
        path.append(grip.offsets[HAND.chains.angles[1]].copy())
    path = np.array(path)
    np.testing.assert_allclose(path[-1], [0.5, 0.1, 0.6, 0.3], atol=1e-3)
    assert np.all(path <= path[-1] * 1.01 + 1e-9)
    steps = np.diff(path[:, 2], prepend=0.0)
    assert np.abs(np.diff(steps, prepend=0.0)).max() < 0.08, "at most an eighth of the way is gained in one tick"
    assert not grip.offsets[HAND.chains.angles[2]].any()


def test_a_finger_eases_toward_the_network_and_stays_where_it_is_when_it_is_needed():
    predicted, numbers = np.zeros(20), np.zeros(GRIP)
    grip, pose = unpack_grip.py_func(numbers, 5), np.array([0.5, 0.1, 0.6, 0.3])
    call(take_pose, HAND.chains, 1, pose, grip)
    for tick in range(60):
        call(ease_fingers, HAND.chains, 0.05 if tick < 10 else 0.0, predicted, grip)
        call(move_finger, HAND.chains, 1, predicted, grip)
    own = HAND.chains.angles[1]
    np.testing.assert_allclose(grip.offsets[own], pose, atol=1e-3, err_msg="it does not ease before it has arrived")
    for _ in range(10):
        call(ease_fingers, HAND.chains, 0.05, predicted, grip)
        call(move_finger, HAND.chains, 1, predicted, grip)
    reached = grip.offsets[own].copy()
    assert np.all(reached < 0.9 * pose)
    for _ in range(60):
        call(ease_fingers, HAND.chains, 0.0, predicted, grip)
        call(move_finger, HAND.chains, 1, predicted, grip)
    np.testing.assert_allclose(grip.offsets[own], reached, rtol=0.15, err_msg="it stops within a few ticks")
    assert not grip.poses[HAND.chains.angles[2]].any()


def test_an_anchor_is_set_at_the_touch_follows_slowly_and_is_lost_far_away(bar):
    surface, anchors = Surface(bar.field, np.eye(3), np.zeros(3), 2.0), np.zeros(5 * ANCHOR)
    tip = np.array([0.04, 0.0, 0.06])
    call(move_anchor, tip, 0.006, surface, anchors, 2)
    assert not anchors.any(), "it does not touch yet"
    for _ in range(20):
        call(move_anchor, tip, 0.001, surface, anchors, 2)
    assert anchors[2 * ANCHOR] > 0.9
    np.testing.assert_allclose(anchors[2 * ANCHOR + 1 : 3 * ANCHOR], tip / 2.0)
    call(move_anchor, np.add(tip, [0.004, 0.0, 0.0]), 0.001, surface, anchors, 2)
    assert 0.02 < anchors[2 * ANCHOR + 1] < 0.0205
    for _ in range(40):
        call(loosen_anchor, anchors, 2, False)
    assert anchors[2 * ANCHOR] == 0.0
