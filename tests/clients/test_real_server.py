"""Every client reads a real server that synthesises hands from bodies."""

import time
from collections.abc import Callable

import pytest
from languages import NAMES, LiveClient
from live_server import Stage, scene
from manipnet_client import Client

RATE_HZ = 120
LIMIT_S = 120.0


def perform_until(stage: Stage, done: Callable[[], bool]) -> None:
    """Send bodies in real time until `done`."""
    stage.start_s += 1000.0
    begin = time.monotonic()
    while not done():
        t = time.monotonic() - begin
        assert t < LIMIT_S
        stage.sender.send(stage.start_s + t, scene(t))
        time.sleep(1 / RATE_HZ)


@pytest.mark.parametrize("name", NAMES)
def test_a_client_reads_the_server(stage: Stage, harness, name: str) -> None:
    addresses = stage.server.addresses
    client = LiveClient.start(harness(name), addresses["web" if name == "javascript" else "hands"])
    try:
        perform_until(stage, lambda: client.ask()["received"] > 60)
        figures = client.ask()
    finally:
        client.kill()
    assert (figures["lost"], figures["refused"], figures["connections"]) == (0, 0, 1)


def test_python_client_reads_the_server(stage: Stage) -> None:
    with Client(stage.server.addresses["hands"], actor="actor") as client:
        perform_until(stage, lambda: client.stats().received > 60)
        hands, shown = client.newest, client.sample()
    assert client.stats().lost == 0
    assert hands is not None
    assert shown is not None
    assert hands.right is not None
    assert shown.hands.left is not None
    assert hands.right.object == "Box"
    assert [body.name for body in hands.bodies] == ["Box", "left_wrist", "right_wrist"]
    assert shown.hands.left.joints.shape == (26, 7)
