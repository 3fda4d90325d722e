"""Who may ask for what: operations that touch files of the server's machine are for clients on that machine."""

import json

import pytest

from manipnet.control.dispatcher import Dispatcher
from manipnet.telemetry import Telemetry


def ask(request: dict, here: bool) -> dict:
    """The answer to a request; handlers of slow operations run on a thread."""
    import queue

    answers: queue.Queue[bytes] = queue.Queue()
    dispatcher = Dispatcher({request["op"]: lambda _: {"done": True}}, Telemetry())
    dispatcher.submit([json.dumps(request).encode()], answers.put, here)
    answer = json.loads(answers.get(timeout=20.0))
    dispatcher.close()
    return answer


@pytest.mark.parametrize("op", ["calibrate", "place_object"])
def test_only_a_client_on_this_machine_changes_the_rig_file(op: str) -> None:
    assert 'add "store": false' in ask({"op": op}, here=False)["error"]
    assert 'add "store": false' in ask({"op": op, "store": True}, here=False)["error"]
    assert ask({"op": op, "store": False}, here=False) == {"done": True}
    assert ask({"op": op}, here=True) == {"done": True}


def test_only_a_client_on_this_machine_opens_files() -> None:
    assert "only a client on that machine" in ask({"op": "add_object", "file": "a.ply"}, here=False)["error"]
    assert ask({"op": "add_object", "file": "a.ply"}, here=True) == {"done": True}
