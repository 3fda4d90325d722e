"""The generated scene of the demo is the shipped one, it loops, and its motion is plausible."""

import numpy as np

from manipnet.demo.player import DEMO_FILE
from manipnet_tools.assets.demo_recording import HOMES, demo_take
from manipnet_tools.takes.take import read_take

TAKE = demo_take()


def test_the_shipped_recording_is_the_generated_one():
    shipped = read_take(DEMO_FILE)
    assert len(shipped.time_s) == len(TAKE.time_s)
    for name, track in TAKE.bodies.items():
        np.testing.assert_allclose(shipped.bodies[name].poses[:, :3], track.poses[:, :3], atol=1e-4)
        along = np.abs(np.sum(shipped.bodies[name].poses[:, 3:] * track.poses[:, 3:], axis=1))
        np.testing.assert_allclose(along, 1.0, atol=1e-5)


def test_the_scene_ends_where_it_begins():
    for track in TAKE.bodies.values():
        np.testing.assert_allclose(track.poses[-1, :3], track.poses[0, :3], atol=0.005)


def test_speeds_are_those_of_a_person():
    for track in TAKE.bodies.values():
        speed = np.linalg.norm(np.diff(track.poses[:, :3], axis=0), axis=1) * TAKE.rate_hz
        assert speed.max() < 1.5


def test_objects_never_sink_into_the_table():
    for name, home in HOMES.items():
        assert TAKE.bodies[name].poses[:, 1].min() > home[1] - 0.002
