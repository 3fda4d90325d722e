"""Parts of the real takes through a real server: every tick has both hands, at the object that they hold."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from live_server import Stage, serving

from manipnet_tools.takes.take import read_take

OBJECTS = {
    "cube_med2": "cube_med",
    "cyl_med3": "cyl_med",
    "cup1": "cup1",
    "mug1": "mug1",
    "teapot2": "teapot2",
    "wineglass3": "wineglass3",
}
"""The mesh of each take."""
SECONDS = 1.5


@pytest.fixture(scope="module")
def stage(manipnet_data: Path, tiny_bundle: Path) -> Iterator[Stage]:
    meshes = [f"--mesh={name}={manipnet_data / 'meshes' / name}.obj" for name in OBJECTS.values()]
    with serving(*meshes, "--model", str(tiny_bundle)) as server:
        stage = Stage(server)
        yield stage
        stage.close()


@pytest.mark.parametrize("name", OBJECTS)
def test_a_real_take_comes_out_complete(stage: Stage, manipnet_data: Path, name: str) -> None:
    take = read_take(manipnet_data / "BVH" / name)
    first = len(take.time_s) // 2

    def poses(t_s: float):
        row = first + round(t_s * take.rate_hz)
        tracks = {OBJECTS[name] if key in take.objects else key: track for key, track in take.bodies.items()}
        return {key: track.poses[row].tolist() for key, track in tracks.items()}

    messages = stage.perform(SECONDS, poses, take.rate_hz)
    assert len(messages) == round(SECONDS * 60) + 1
    for message in messages:
        assert set(message.hands) == {"left", "right"}
        for hand in message.hands.values():
            assert np.isfinite(hand.joints).all()
    settled = [hand for message in messages[30:] for hand in message.hands.values()]
    assert {(hand.state, hand.object) for hand in settled} == {("live", OBJECTS[name])}
