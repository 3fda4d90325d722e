"""Every client on the real server, which synthesises from bodies it is sent."""

import pytest
from languages import NAMES, LiveClient
from manipnet_client import Client

from live_server import Stage, scene


@pytest.mark.parametrize("name", NAMES)
def test_a_client_reads_the_server(stage: Stage, harness, name: str) -> None:
    addresses = stage.server.addresses
    client = LiveClient.start(harness(name), addresses["page" if name == "javascript" else "hands"])
    try:
        client.ask_until(lambda f: f["connections"] == 1)
        received = 0
        while received < 60:  # until the first performance that begins after the subscription has taken effect
            stage.perform(1.2, scene)
            received = client.ask()["received"]
        figures = client.ask()
    finally:
        client.kill()
    assert (figures["lost"], figures["refused"]) == (0, 0)


def test_python_client_sees_what_the_server_means(stage: Stage) -> None:
    with Client(stage.server.addresses["hands"], actor="actor") as client:
        sent = {}
        while (hands := client.newest) is None or hands.seq not in sent:
            sent = {message.seq: message for message in stage.perform(0.6, scene)}
    message = sent[hands.seq]
    assert hands.right.joints == pytest.approx(message.hands["right"].joints, abs=1e-5)
    assert hands.right.object == "Box"
    assert [body.name for body in hands.bodies] == [body.name for body in message.bodies]
