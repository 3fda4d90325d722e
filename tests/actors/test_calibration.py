"""Calibration of any cluster on any hand and any sheet, and the refusal of everything else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from manipnet.actors.actor import Actor
from manipnet.actors.calibration import (
    HAND_LENGTH_M,
    MARK_M,
    CalibrationError,
    calibrate_wrist,
    difference,
    measured_length,
    scaled_offset,
    sheet_at,
    sheet_under,
    steady_pose,
    upright_on_sheet,
    wrist_on_sheet,
)
from manipnet.actors.plan import synthesise
from manipnet.actors.props import Prop
from manipnet.config.settings import ActorConfig, BodyConfig
from manipnet.geometry import Array, Side, compose, invert, mirror_points, quat_exp, quat_multiply, quat_rotate
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.skin import skinned
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.library import load_library_mesh
from manipnet.synthesis.objects.shape import Shape, build_shape
from manipnet.synthesis.synthesizer import Synthesizer
from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import BodyFrame, BodySample

HAND = shipped_hand()

SIDES: tuple[Side, Side] = ("left", "right")
SAMPLES = 240
NOISE_M, NOISE_RAD = 0.5e-3, np.radians(0.7)
"""Noise of a cluster whose markers, 4 cm from its middle, are each seen within half a millimetre."""
HERE = sheet_at(np.array([0.3, 0.74, -0.2]), 0.4)

numbers = st.floats(-1.0, 1.0)
rotations = st.tuples(numbers, numbers, numbers, numbers).filter(lambda q: np.linalg.norm(q) > 0.1)
points = st.tuples(numbers, numbers, numbers)


def pose(p, q=(0.0, 0.0, 0.0, 1.0)) -> Array:
    return np.concatenate([p, np.array(q) / np.linalg.norm(q)])


def noisy(poses: Array, seed: int = 0, size: float = 1.0) -> Array:
    """The poses as a tracker sees them, with noise and with quaternions whose signs flip."""
    rng = np.random.default_rng(seed)
    p = poses[:, :3] + size * rng.normal(0.0, NOISE_M, (len(poses), 3))
    q = quat_multiply(poses[:, 3:], quat_exp(size * rng.normal(0.0, NOISE_RAD, (len(poses), 3))))
    return np.concatenate([p, q * rng.choice([-1.0, 1.0], (len(poses), 1))], axis=1)


def held(T: Array, seed: int = 0) -> Array:
    return noisy(np.tile(T, (SAMPLES, 1)), seed)


@given(where=points, turn=rotations, sheet=points, yaw=st.floats(-4.0, 4.0), scale=st.floats(0.75, 1.25))
@pytest.mark.parametrize("side", SIDES)
def test_any_cluster_is_found_within_two_millimetres_and_a_degree(side: Side, where, turn, sheet, yaw, scale) -> None:
    T_cluster_wrist = pose(0.1 * np.array(where), turn)
    T_world_sheet = sheet_at(np.array(sheet), yaw)
    T_world_wrist = compose(T_world_sheet, wrist_on_sheet(side, scale))
    steady = steady_pose(held(compose(T_world_wrist, invert(T_cluster_wrist))), "it")
    away_m, away_rad = difference(calibrate_wrist(side, steady, T_world_sheet, scale), T_cluster_wrist)
    assert away_m < 2e-3
    assert away_rad < np.radians(1.0)


@given(turn=rotations, seed=st.integers(0, 999))
def test_outliers_are_left_out(turn, seed: int) -> None:
    T = pose((0.4, 1.0, 0.2), turn)
    poses = held(T, seed)
    poses[5::8] = held(compose(T, pose((0.3, 0.1, 0.0), (1.0, 1.0, 0.0, 0.0))), seed + 1)[5::8]
    steady = steady_pose(poses, "it")
    assert steady.outliers == SAMPLES // 8
    away_m, away_rad = difference(steady.pose, T)
    assert away_m < 1e-3
    assert away_rad < np.radians(0.5)


def moving(speed_m_s: float = 0.0, spin_rad_s: float = 0.0) -> Array:
    t = np.linspace(0.0, 2.0, SAMPLES)[:, None]
    p, q = t * [speed_m_s, 0.0, 0.0], quat_exp(t * [0.0, spin_rad_s, 0.0])
    return noisy(np.concatenate([p, q], axis=1))


def trembling() -> Array:
    return noisy(np.tile(pose((0.0, 0.0, 0.0)), (SAMPLES, 1)), size=6.0)


def in_two_places() -> Array:
    poses = held(pose((0.0, 0.0, 0.0)))
    poses[::3, 0] += 0.2
    return poses


@pytest.mark.parametrize(
    ("poses", "complaint"),
    [
        (
            held(HERE)[:7],
            "left_wrist: only 7 tracked samples in that time, and at least 20 are needed; make sure that it is tracked",
        ),
        (
            moving(speed_m_s=0.005),
            r"left_wrist moved by 6\.\d mm .* at most 3\.0 mm and 1\.5° are allowed",
        ),
        (moving(spin_rad_s=0.05), r"left_wrist moved by .* while it had to be still"),
        (
            trembling(),
            r"left_wrist trembles by 5\.\d mm .* at most 3\.0 mm and 2\.0° are allowed: rest it on the table",
        ),
        (in_two_places(), "left_wrist: 80 of 240 samples are far from the others; it moved, or its markers"),
    ],
)
def test_a_body_that_was_not_still_is_refused_with_the_reason(poses: Array, complaint: str) -> None:
    with pytest.raises(CalibrationError, match=complaint):
        steady_pose(poses, "left_wrist")


def test_the_quality_tells_a_calm_hand_from_a_shaky_one() -> None:
    assert steady_pose(noisy(np.tile(HERE, (SAMPLES, 1)), size=0.3), "it").good
    assert not steady_pose(noisy(np.tile(HERE, (SAMPLES, 1)), size=1.6), "it").good


@pytest.mark.parametrize("side", SIDES)
def test_a_hand_that_is_not_on_its_mark_is_refused(side: Side) -> None:
    far = steady_pose(held(compose(HERE, pose((1.0, 0.0, 0.0)))), "it")
    with pytest.raises(CalibrationError, match=f"{side}_wrist is .* m from the {side} wrist's mark.*where the sheet"):
        calibrate_wrist(side, far, HERE, 1.0)
    other: Side = "left" if side == "right" else "right"
    crossed = steady_pose(held(compose(HERE, wrist_on_sheet(other))), "it")
    with pytest.raises(CalibrationError, match=f"it is at the {other} hand's mark: swap the two bodies"):
        calibrate_wrist(side, crossed, HERE, 1.0)


@pytest.mark.parametrize("side", SIDES)
def test_the_shown_pose_is_the_models_flat_hand_on_a_table(side: Side) -> None:
    positions, rotations = forward_kinematics(HAND, np.zeros(20))
    vertices = skinned(HAND, positions, rotations)
    hand = mirror_points(vertices) if side == "left" else vertices
    hand = wrist_on_sheet(side)[:3] + quat_rotate(wrist_on_sheet(side)[3:], hand)
    heel = hand[np.abs(vertices[:, 0]) < 0.02]
    assert heel[:, 1].min() == pytest.approx(0.0, abs=1e-3), "the heel of the hand touches the table"
    tip = hand[(np.abs(vertices[:, 1]) < 0.02) & (vertices[:, 0] > 0.2)]
    assert MARK_M[1] - tip[:, 2].min() == pytest.approx(HAND_LENGTH_M, abs=1e-3)
    thumb = hand[vertices[:, 1] > 0.06]
    assert (np.abs(thumb[:, 0]) < MARK_M[0]).all(), "thumbs are inside"


@given(scale=st.floats(0.7, 1.25), where=points, turn=rotations)
@pytest.mark.parametrize("side", SIDES)
def test_the_size_of_a_hand_is_measured_by_a_touch_of_its_fingertip(side: Side, scale: float, where, turn) -> None:
    """Wrists first, with the size unknown; then the hands drawn back until their tips touch the centre line."""
    T_cluster_wrist = pose(0.1 * np.array(where), turn)
    flat = compose(compose(HERE, wrist_on_sheet(side, scale)), invert(T_cluster_wrist))
    offset = calibrate_wrist(side, steady_pose(held(flat), "it"), HERE, 1.0)
    back = wrist_on_sheet(side, scale) + np.array([0.0, 0.0, scale * HAND_LENGTH_M - MARK_M[1], 0, 0, 0, 0])
    touching = compose(compose(HERE, back), invert(T_cluster_wrist))
    wrist = compose(steady_pose(held(touching, 1), "it").pose, offset)
    found = measured_length(side, wrist, HERE) / HAND_LENGTH_M
    assert found == pytest.approx(scale, abs=0.01)
    away_m, _ = difference(scaled_offset(offset, 1.0, found), T_cluster_wrist)
    assert away_m < 2e-3


@pytest.mark.parametrize(
    ("x", "z", "complaint"),
    [(0.12, 0.4, "allowed are 0.12 … 0.28 m"), (0.18, 0.2, "points 6 cm beside its mark"), (0.12, -0.2, "allowed are")],
)
def test_a_touch_elsewhere_is_refused(x: float, z: float, complaint: str) -> None:
    T_sheet_wrist = wrist_on_sheet("right")
    T_sheet_wrist[[0, 2]] = x, z
    with pytest.raises(CalibrationError, match=complaint):
        measured_length("right", compose(HERE, T_sheet_wrist), HERE)


@given(yaw=st.floats(-3.0, 3.0), where=points)
def test_a_tracked_prop_may_tell_where_the_sheet_lies(yaw: float, where) -> None:
    T_world_sheet = sheet_at(np.array(where), yaw)
    found = sheet_under(upright_on_sheet(T_world_sheet, -0.03), where[1])
    assert np.allclose(difference(found, T_world_sheet), 0.0, atol=1e-6)


def test_a_prop_whose_x_axis_is_vertical_is_refused() -> None:
    with pytest.raises(CalibrationError, match="x axis of the reference object points up or down"):
        sheet_under(pose((0, 0, 0), (0.0, 0.0, 1.0, 1.0)), 0.0)


# --- the fingers after a calibration


@pytest.fixture(scope="module")
def cube() -> Shape:
    return build_shape(load_library_mesh("cube"))


@pytest.fixture(scope="module")
def bundle():
    return load_bundle("manipnet-small")


SECONDS = 1.5


def around(shape_scale: float, t_s: float, size: float) -> dict[str, Array]:
    """Two hands that come to a box and swing it, everything `size` times as large."""
    near = 0.10 + 0.05 * np.exp(-3.0 * t_s)
    swing = pose((0.04 * np.sin(3.0 * t_s), 1.0, 0.0), quat_exp(np.array([0.0, 0.4 * np.sin(2.0 * t_s), 0.0])))
    right = compose(swing, pose((near, 0.02, 0.09), (-0.4, 0.5, 0.45, 0.5)))
    left = compose(swing, pose((-near, 0.0, 0.1), (-0.5, -0.45, -0.5, 0.5)))
    scaled = np.append(np.full(3, size), np.ones(4))
    return {"left_wrist": left * scaled, "right_wrist": right * scaled, "box": swing * scaled}


def fingers(bundle, shape: Shape, config: ActorConfig, clusters: dict[str, Array], size: float = 1.0) -> Array:
    """Angles `(ticks, 2, 20)` of an actor whose tracker sees the wrists through `clusters`, T_wrist_cluster each."""
    actor = Actor(config, [Prop("box", "cube", shape)], bundle, Telemetry(), 0.1)
    actor.carry("box", "cube", shape, 1.4 * size)
    synthesizer, shown = Synthesizer(bundle, solver="least_squares"), []
    for i in range(round(SECONDS * 120)):
        poses = around(1.4, i / 120, size)
        poses |= {name: compose(poses[name], T) for name, T in clusters.items()}
        bodies = tuple(BodySample(None, name, tuple(T[:3]), tuple(T[3:]), True) for name, T in poses.items())
        actor.push(BodyFrame(i / 120, None, bodies, i / 120, "zmq:test"))
        while (tick := actor.poll(i / 120)) is not None:
            plan = actor.plan(tick)
            synthesise([plan], synthesizer)
            hands = actor.show(plan)
            shown.append([hands[side].angles for side in SIDES])
    return np.array(shown)


def apart(a: Array, b: Array) -> Array:
    """Distances of the joints of hands posed by two sets of angles `(..., 20)`."""
    return np.linalg.norm(forward_kinematics(HAND, a)[0] - forward_kinematics(HAND, b)[0], axis=-1)


def actor_config(offsets: dict[str, Array] | None = None, hand_scale: float = 1.0) -> ActorConfig:
    wrists = {name: BodyConfig(name, (offsets or {}).get(name)) for name in ("left_wrist", "right_wrist")}
    return ActorConfig("actor", wrists, (), hand_scale)


@pytest.mark.slow
def test_fingers_after_calibration_are_those_of_the_true_wrists(bundle, cube: Shape) -> None:
    rng = np.random.default_rng(8)
    true = {side: pose(rng.normal(0.0, 0.05, 3), rng.normal(size=4)) for side in SIDES}
    found = {}
    for side in SIDES:
        cluster = compose(compose(HERE, wrist_on_sheet(side)), invert(true[side]))
        found[f"{side}_wrist"] = calibrate_wrist(side, steady_pose(held(cluster), side), HERE, 1.0)
    wanted = fingers(bundle, cube, actor_config(), {})
    clusters = {f"{side}_wrist": invert(true[side]) for side in SIDES}
    angles = fingers(bundle, cube, actor_config(found), clusters)
    assert np.abs(wanted - wanted[0]).max() > 0.2, "the fingers do something"
    away_m = apart(angles, wanted)
    assert np.percentile(away_m, 99) < 2e-3
    assert np.mean(apart(fingers(bundle, cube, actor_config(), clusters), wanted)) > 0.01


@pytest.mark.parametrize("size", [0.8, 0.9, 1.1, 1.2])
def test_hands_of_another_size_do_the_same_in_a_scene_of_that_size(bundle, cube: Shape, size: float) -> None:
    wanted = fingers(bundle, cube, actor_config(), {})
    angles = fingers(bundle, cube, actor_config(hand_scale=size), {}, size)
    assert np.abs(angles - wanted).max() < 1e-6


def test_a_new_offset_applies_to_the_past_as_well(bundle, cube: Shape) -> None:
    """Earlier poses are seen as if the offset had been there from the start, so nothing jumps."""
    offset = pose((0.02, 0.03, -0.01), (0.1, 0.3, -0.2, 0.9))
    actors = {}
    for name, config in (("late", actor_config()), ("always", actor_config({"right_wrist": offset}))):
        actor = Actor(config, [Prop("box", "cube", cube)], bundle, Telemetry(), 0.1)
        for i in range(60):
            T = around(1.4, i / 120, 1.0)["right_wrist"]
            sample = BodySample(None, "right_wrist", tuple(T[:3]), tuple(T[3:]), True)
            actor.push(BodyFrame(i / 120, None, (sample,), i / 120, "zmq:test"))
        actors[name] = actor
    actors["late"].place("right_wrist", offset)
    late, always = (actors[name].poll(1.0).bodies["right_wrist"].window for name in ("late", "always"))
    assert np.allclose(late, always, atol=1e-12)
    assert np.array_equal(actors["late"].config.wrists["right_wrist"].offset, offset)
    raw = [actor.body_poses("right_wrist", 2.0) for actor in actors.values()]
    assert np.allclose(raw[0], raw[1], atol=1e-12)
