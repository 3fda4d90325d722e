"""A hand profile stays in the server while its client runs: after a restart, too; a refusal has the server's reason."""

import time
from collections.abc import Callable

import numpy as np
from live_server import serving
from manipnet_client import Client, ControlClient, HandUpload
from manipnet_client.avatar import AvatarHand, RigHand, avatar_profile
from manipnet_client.layout import REST_JOINTS

from manipnet.geometry import SIDES

WAIT_S = 60.0


def until(condition: Callable[[], object]) -> None:
    give_up = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < give_up, "never true"
        time.sleep(0.05)


def profile(size: float = 1.0) -> dict:
    """The hands of a rig that is `size` times as large as the model's hand."""
    hands = {}
    for side in SIDES:
        points = size * REST_JOINTS[:, :3] * ([-1.0, 1.0, 1.0] if side == "left" else 1.0)
        rows = [joint for first in (2, 7, 12, 17, 22) for joint in range(first, first + 3)]
        tips = points[[5, 10, 15, 20, 25]]
        hands[side] = AvatarHand(side, RigHand(points[rows], np.tile([0.0, 0.0, 0.0, 1.0], (15, 1)), tips))
    return avatar_profile("avatar", hands)


def test_a_restarted_server_has_the_profile_again(tiny_bundle) -> None:
    wanted = profile()
    with serving("--model", str(tiny_bundle)) as server:
        hands, control = server.addresses["hands"], server.addresses["control"]
        client = Client(hands, hand=wanted["name"])
        upload = HandUpload(ControlClient(control), wanted, lambda: client.stats().age_s)
        until(lambda: upload.uploads == 1)
        assert not upload.problem
    try:
        until(lambda: "cannot be uploaded" in upload.problem)
        taken = upload.uploads
        port, control_port = (address.rpartition(":")[2] for address in (hands, control))
        with serving("--model", str(tiny_bundle), "--port", port, "--control-port", control_port):
            until(lambda: upload.uploads > taken and not upload.problem)
    finally:
        upload.close()
        client.close()


def test_a_refusal_has_the_reason_of_the_server(tiny_bundle) -> None:
    with serving("--model", str(tiny_bundle)) as server:
        control = ControlClient(server.addresses["control"])
        with HandUpload(control, profile(10.0), lambda: float("inf")) as upload:
            until(lambda: upload.problem)
            assert upload.problem.startswith("The server refuses the hand profile: ")
            assert "m long" in upload.problem
            assert upload.uploads == 0
