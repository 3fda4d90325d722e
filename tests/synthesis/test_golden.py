"""A tick computes what it computed before: features and hands of a written scene are compared with stored ones.

A change for speed must leave these results alone. After an intended change of the sensors or the solver, store them
again with `PYTHONPATH=tests/support python tests/synthesis/test_golden.py`.
"""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from tiny_bundle import write_tiny_bundle
from written_scene import scenes_at

from manipnet.actors.hands_message import hand_poses
from manipnet.actors.transitions import ShownHand
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.ik.pose import FEEDBACK_SHARE
from manipnet.synthesis.model.bundle import Bundle, load_bundle
from manipnet.synthesis.model.features import features
from manipnet.synthesis.model.layout import PRESENT, layout_of
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.shape import build_shape
from manipnet.synthesis.synthesizer import HandScene, HandState, HandStep, Synthesizer, windows_of
from manipnet.wire import Side
from manipnet_tools.bench.shapes import gourd

HAND = shipped_hand()
LAYOUT = layout_of(HAND)

STORED = Path(__file__).with_name("golden.npz")
TICKS = 6
FEATURES_WITHIN = 2e-5
"""Metres, or the unit of the column: rays are traced in single precision."""
POSES_WITHIN = 2e-5
"""Radians, metres, parts of a quaternion."""
STRAY_RAYS = 3
"""Rays that graze an edge may go either way on another machine."""


def compute(bundle: Bundle, cache: Path, count: int = TICKS) -> dict[str, np.ndarray]:
    """The features and hands of the first `count` ticks, by name, `(count, hands, …)`."""
    shapes = [build_shape(gourd(triangles), cache) for triangles in (2000, 300)]
    synthesizer = Synthesizer(bundle, solver="least_squares")
    states = [synthesizer.rest_state() for _ in range(3)]
    ticks: list[dict[str, list[np.ndarray]]] = []
    for tick in range(count):
        scenes = scenes_at(tick, shapes)
        rows = [_features(scene, state) for scene, state in zip(scenes, states, strict=True)]
        steps = synthesizer.step(scenes, states)
        states = [step.state for step in steps]
        ticks.append(
            {
                "features": rows,
                "angles": [step.angles for step in steps],
                "positions": [step.positions for step in steps],
                "raw_positions": [step.raw_positions for step in steps],
                "distances": [step.distances for step in steps],
            }
            | _in_world(bundle.hand, scenes, steps)
        )
    return {name: np.array([tick[name] for tick in ticks], dtype=np.float32) for name in ticks[0]}


def _in_world(hand: Hand, scenes: list[HandScene], steps: list[HandStep]) -> dict[str, list[np.ndarray]]:
    """What clients receive of each hand, of a size other than 1."""
    pairs: list[tuple[Side, ShownHand]] = [
        (scene.side, ShownHand("live", step.angles, scene.wrist[PRESENT], None))
        for scene, step in zip(scenes, steps, strict=True)
    ]
    poses = list(hand_poses(HAND, dict(pairs[:2]), 1.1).values()) + list(
        hand_poses(HAND, dict(pairs[2:]), 1.1).values()
    )
    return {"joints": [pose.joints for pose in poses], "local_rotations": [pose.rotations for pose in poses]}


def _features(scene: HandScene, state: HandState) -> np.ndarray:
    return features(HAND, scene.shape, windows_of([scene]), state.positions[None], state.rotations[None])[0]


@pytest.fixture(scope="module")
def computed(tiny_bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    return compute(load_bundle(tiny_bundle), tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="module")
def stored() -> dict[str, np.ndarray]:
    with np.load(STORED, allow_pickle=False) as data:
        return dict(data)


def test_features_are_unchanged(computed: dict[str, np.ndarray], stored: dict[str, np.ndarray]) -> None:
    off = np.abs(computed["features"] - stored["features"]) > FEATURES_WITHIN
    rays = off[..., LAYOUT.input["proximity"].columns]
    assert rays.sum() <= STRAY_RAYS
    assert off.sum() == rays.sum(), f"columns {np.unique(np.argwhere(off)[:, -1])[:20]} differ"


def test_the_scene_exercises_every_sensor_and_the_solver(stored: dict[str, np.ndarray]) -> None:
    rays = stored["features"][..., LAYOUT.input["proximity"].columns]
    assert rays.min() < 0.0 < rays[rays > 0.0].min() < 0.01, "sensors inside, near and far"
    assert stored["features"][..., LAYOUT.input["ambient"].columns].mean() > 0.01
    assert stored["features"][..., LAYOUT.input["signed_distances"].columns].min() < 0.01
    assert np.abs(stored["positions"] - stored["raw_positions"]).max() > 1e-3, "the solver has work to do"


@pytest.mark.parametrize("name", ["angles", "positions", "raw_positions", "distances", "joints", "local_rotations"])
def test_hands_are_unchanged(name: str, computed: dict[str, np.ndarray], stored: dict[str, np.ndarray]) -> None:
    np.testing.assert_allclose(computed[name], stored[name], rtol=0.0, atol=POSES_WITHIN)


def test_a_hand_does_not_depend_on_its_batch(tiny_bundle: Path, tmp_path: Path) -> None:
    shapes = [build_shape(gourd(triangles), tmp_path) for triangles in (2000, 300)]
    synthesizer = Synthesizer(load_bundle(tiny_bundle))
    scenes = [scene for tick in range(TICKS) for scene in scenes_at(tick, shapes)]
    rest = synthesizer.rest_state()
    together = synthesizer.step(scenes, [rest] * len(scenes))
    for scene, step in zip(scenes, together, strict=True):
        alone = synthesizer.step([scene], [rest])[0]
        np.testing.assert_allclose(step.angles, alone.angles, rtol=0.0, atol=1e-6)


def test_the_next_tick_sees_part_of_the_correction(tiny_bundle: Path, tmp_path: Path) -> None:
    shapes = [build_shape(gourd(triangles), tmp_path) for triangles in (2000, 300)]
    synthesizer = Synthesizer(load_bundle(tiny_bundle))
    step = synthesizer.step(scenes_at(0, shapes), [synthesizer.rest_state()] * 3)[0]
    predicted = (step.state.angles - FEEDBACK_SHARE * step.angles) / (1.0 - FEEDBACK_SHARE)
    assert np.abs(step.angles - predicted).max() > 0.01, "the solver has work to do"
    np.testing.assert_allclose(forward_kinematics(HAND, predicted)[0], step.raw_positions, atol=1e-9)
    np.testing.assert_allclose(forward_kinematics(HAND, step.angles)[0], step.positions, atol=1e-9)
    np.testing.assert_allclose(forward_kinematics(HAND, step.state.angles)[0], step.state.positions, atol=1e-9)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        bundle = load_bundle(write_tiny_bundle(Path(folder) / "tiny"))
        np.savez_compressed(STORED, **compute(bundle, Path(folder)))  # pyright: ignore[reportArgumentType]
    print(f"stored {STORED}")
