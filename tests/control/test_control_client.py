"""The control client against a control port in this process, over real sockets."""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import zmq

from manipnet.common.options import ConfigError
from manipnet.control.client import ControlClient
from manipnet.control.dispatcher import Dispatcher
from manipnet.control.request import Request, RequestError
from manipnet.control.service import Control
from manipnet.net.curve_keys import make_client_keys, make_server_keys
from manipnet.telemetry import Telemetry


def ping(request: Request) -> dict:
    return {"time": 12.5, "request": dict(request)}


def refuse(request: Request) -> dict:
    raise RequestError(f"seconds is {request['seconds']}; allowed are 0 to 0.5")


HANDLERS = {"ping": ping, "look_ahead": refuse}


@pytest.fixture
def control() -> Iterator[Control]:
    control = Control("127.0.0.1", 0, Dispatcher(HANDLERS, Telemetry()), Telemetry())
    control.start()
    yield control
    control.stop()


def test_an_answer_comes_back(control: Control) -> None:
    answer = ControlClient(control.address).ask("ping", name="ann")
    assert answer == {"time": 12.5, "request": {"op": "ping", "name": "ann"}}
    assert ControlClient(control.address.removeprefix("tcp://")).ask("ping")["time"] == 12.5


def test_a_refusal_is_the_servers_own_text(control: Control) -> None:
    with pytest.raises(RequestError, match=r"^seconds is 9; allowed are 0 to 0.5$"):
        ControlClient(control.address).ask("look_ahead", seconds=9)


def test_a_server_with_keys_answers_a_client_that_is_on_its_list(tmp_path: Path) -> None:
    keys = make_server_keys(tmp_path)
    ann = make_client_keys(tmp_path, "ann")
    control = Control("127.0.0.1", 0, Dispatcher(HANDLERS, Telemetry()), Telemetry(), keys)
    control.start()
    try:
        assert ControlClient(control.address, ann).ask("ping")["time"] == 12.5
        with pytest.raises(TimeoutError):
            ControlClient(control.address, timeout_s=0.1).ask("ping")
    finally:
        control.stop()


def test_silence_is_a_timeout_that_names_the_address() -> None:
    with pytest.raises(TimeoutError, match=r"no server answers at tcp://127.0.0.1:1 within 0.05 s"):
        ControlClient("127.0.0.1:1", timeout_s=0.05).ask("ping")


@pytest.mark.parametrize("content", [b"hello", b"[1, 2]", b"\xff"])
def test_an_answer_of_another_program_is_an_error(content: bytes) -> None:
    with zmq.Context() as context, context.socket(zmq.REP) as stranger:
        port = stranger.bind_to_random_port("tcp://127.0.0.1")
        thread = threading.Thread(target=lambda: (stranger.recv(), stranger.send(content)))
        thread.start()
        with pytest.raises(ConnectionError, match="is not a server of ManipNet Live"):
            ControlClient(f"127.0.0.1:{port}").ask("ping")
        thread.join()


@pytest.mark.parametrize("address", ["", "127.0.0.1:port", "127.0.0.1:99999"])
def test_a_malformed_address_is_refused(address: str) -> None:
    with pytest.raises(ConfigError):
        ControlClient(address)
