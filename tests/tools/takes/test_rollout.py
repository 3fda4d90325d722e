"""The offline driver: what it shows the synthesis, and that it steps all hands."""

from dataclasses import replace

import numpy as np
import pytest

from manipnet import geometry
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.mesh import closed_mesh
from manipnet.synthesis.objects.shape import build_shape
from manipnet.synthesis.synthesizer import Synthesizer
from manipnet.wire import SIDES
from manipnet_tools.takes.rollout import hand_inputs, roll_out, tick_take
from manipnet_tools.takes.take import BodyTrack, Take, TakeError

HAND = shipped_hand()

NAMES = ("left_wrist", "right_wrist", "box")
VELOCITY = np.array([0.1, -0.2, 0.3])
SPIN = np.array([0.0, 1.5, 0.0])


def steady_take(rate_hz: float, seconds: float = 3.0) -> Take:
    """All bodies move and turn steadily, on a clock that does not start at zero."""
    time = np.arange(round(seconds * rate_hz)) / rate_hz
    track = BodyTrack(steady_poses(time), np.ones(len(time), dtype=np.bool_))
    return Take("steady", rate_hz, 100.0 + time, dict.fromkeys(NAMES, track))


def steady_poses(time: np.ndarray) -> np.ndarray:
    return np.concatenate([VELOCITY * time[..., None], geometry.quat_exp(SPIN * time[..., None])], axis=-1)


@pytest.mark.parametrize(("rate_hz", "tolerance"), [(48.0, 1e-3), (60.0, 1e-9), (120.0, 1e-9), (333.0, 1e-3)])
def test_ticks_are_sixty_a_second_at_any_rate(rate_hz, tolerance):
    # where no sample falls on the end of the window, live would not have the next one yet: it is a forecast
    ticks = tick_take(steady_take(rate_hz))
    np.testing.assert_allclose(np.diff(ticks.time_s), 1 / 60, atol=1e-9)
    assert ticks.time_s[0] == pytest.approx(0.5)
    assert 2.5 - 1 / rate_hz - 1 / 60 < ticks.time_s[-1] < 2.5 + 1 / 60
    instants = ticks.time_s[:, None] + np.linspace(-0.5, 0.5, 21)
    for body in ticks.bodies.values():
        np.testing.assert_allclose(body.windows, steady_poses(instants), atol=tolerance)
        np.testing.assert_allclose(body.poses, steady_poses(ticks.time_s), atol=1e-5)


def test_a_shorter_look_ahead_sees_a_forecast_and_loses_less_of_the_end():
    full, short = tick_take(steady_take(120.0)), tick_take(steady_take(120.0), look_ahead_s=0.1)
    assert len(short.time_s) == len(full.time_s) + 24
    seen, guessed = (ticks[: len(full.time_s)].bodies["box"].windows for ticks in (full, short))
    np.testing.assert_allclose(guessed[:, :13], seen[:, :13], atol=1e-6)
    assert np.abs(guessed[:, -1] - seen[:, -1]).max() > 0.01


def test_an_object_that_is_never_tracked_costs_only_itself(caplog):
    take = steady_take(120.0)
    lost = BodyTrack(take.bodies["box"].poses, np.zeros(len(take.time_s), dtype=np.bool_))
    ticks = tick_take(replace(take, bodies=take.bodies | {"Ann:Head": lost}))
    assert set(ticks.bodies) == set(NAMES)
    assert "these bodies are left out because they are never tracked: Ann:Head" in caplog.text
    with pytest.raises(TakeError, match="Ann:Head has a mesh but is never tracked in the take"):
        hand_inputs(ticks, {"Ann:Head": cube()})
    with pytest.raises(TakeError, match="left_wrist is never tracked while the other bodies are"):
        tick_take(replace(take, bodies=take.bodies | {"left_wrist": lost}))


def test_a_body_that_is_not_seen_contributes_nothing():
    take = steady_take(120.0)
    poses, seen = take.bodies["box"].poses.copy(), take.bodies["box"].tracked.copy()
    hidden = (take.time_s > 101.0) & (take.time_s < 101.1)
    poses[hidden], seen[hidden] = np.nan, False
    ticks = tick_take(replace(take, bodies=take.bodies | {"box": BodyTrack(poses, seen)}))
    windows = ticks.bodies["box"].windows
    instants = ticks.time_s[:, None] + np.linspace(-0.5, 0.5, 21)
    assert np.isfinite(windows).all()
    np.testing.assert_allclose(windows[:, :10], steady_poses(instants)[:, :10], atol=1e-6)


def test_slices_keep_all_columns_together():
    ticks = tick_take(steady_take(60.0))
    part = ticks[5:9]
    np.testing.assert_array_equal(part.time_s, ticks.time_s[5:9])
    np.testing.assert_array_equal(part.bodies["box"].poses, ticks.bodies["box"].poses[5:9])


def cube(size: float = 0.06):
    corners = (np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]) - 0.5) * size
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return build_shape(
        closed_mesh(corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]), "cube")
    )


def still_take(**positions: tuple[float, float, float]) -> Take:
    """Bodies that stand still at the given places."""
    time = np.arange(180) / 60.0
    seen = np.ones(len(time), dtype=np.bool_)
    bodies = {name: BodyTrack(np.tile([*p, 0.0, 0.0, 0.0, 1.0], (len(time), 1)), seen) for name, p in positions.items()}
    return Take("still", 60.0, time, bodies)


def test_each_hand_deals_with_the_nearest_object():
    take = still_take(left_wrist=(-0.3, 1, 0), right_wrist=(0.3, 1, 0), one=(-0.42, 1, -0.1), two=(0.4, 1, -0.1))
    shapes = {"one": cube(), "two": cube(0.05)}
    inputs = hand_inputs(tick_take(take), shapes)
    for side, name in zip(SIDES, ("one", "two"), strict=True):
        scene = inputs[side].scene(7)
        assert scene.shape is shapes[name]
        np.testing.assert_allclose(scene.object[3], take.bodies[name].poses[0])


def test_a_hand_turns_to_the_object_that_comes_nearer():
    take = still_take(left_wrist=(-0.3, 1, 0), right_wrist=(0.3, 1, 0), one=(0.42, 1, -0.1), two=(0.6, 1, -0.1))
    seconds = take.time_s[:, None]
    arriving = take.bodies["two"].poses - np.clip(seconds - 1.5, 0.0, 0.2) * np.eye(7)[0]
    leaving = take.bodies["one"].poses - np.clip(seconds - 1.5, 0.0, 0.2) * np.eye(7)[0]
    seen = take.bodies["one"].tracked
    bodies = take.bodies | {"one": BodyTrack(leaving, seen), "two": BodyTrack(arriving, seen)}
    held = hand_inputs(tick_take(replace(take, bodies=bodies)), {"one": cube(), "two": cube()})["right"].held
    assert (held[0], held[-1]) == (0, 1)
    assert np.count_nonzero(np.diff(held)) == 1


def test_hands_of_different_lengths_are_rolled_out_together(still_model):
    bundle = load_bundle(still_model)
    take = still_take(left_wrist=(-0.3, 1, 0), right_wrist=(0.3, 1, 0), box=(0.4, 1, 0))
    inputs = hand_inputs(tick_take(take), {"box": cube()})
    hands = [inputs["left"][:3], inputs["right"]]
    heard: list[int] = []
    motions = roll_out(Synthesizer(bundle, "none"), hands, heard.append)
    assert [len(motion.positions) for motion in motions] == [3, len(inputs["right"])]
    assert sum(heard) == 3 + len(inputs["right"])
    for motion in motions:
        positions, _ = forward_kinematics(HAND, motion.angles)
        np.testing.assert_allclose(motion.positions, positions)
        np.testing.assert_allclose(motion.raw_positions, positions)
        np.testing.assert_allclose(motion.distances, 0.035)
