"""Every input that listens on a port frees it, takes it again, and names what prevents it from listening."""

import threading
from collections.abc import Callable

import pytest

from manipnet.inputs import INPUTS
from manipnet.inputs.declaration import Input, Receiver, Reception
from manipnet.net.errors import ListenError
from manipnet.wire.bodies import BodyFrame, BodySample

LISTENING = [declared for declared in INPUTS if declared.transport is not None]
Make = Callable[..., Receiver]


@pytest.fixture(params=LISTENING, ids=lambda declared: declared.name)
def declared(request: pytest.FixtureRequest) -> Input:
    return request.param


@pytest.fixture
def make(declared: Input, heard, telemetry) -> Make:
    """Makes a receiver, which is not started, for a port and a host."""

    def make(port: int = 0, host: str = "127.0.0.1") -> Receiver:
        options = declared.options(**{declared.where.field: port})
        return declared.open(options, Reception(declared.intake(heard, telemetry), host))

    return make


def port_of(receiver: Receiver) -> int:
    return int(receiver.address.rpartition(":")[2])


def test_stop_frees_the_port_and_start_takes_it_again(declared: Input, make: Make, heard) -> None:
    assert declared.player is not None
    threads = threading.active_count()
    port = 0
    for n in range(3):
        receiver = make(port)
        receiver.start()
        port = port_of(receiver)
        sender = declared.player("127.0.0.1", port)
        body = BodySample(1, None, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), True)
        sender.send(BodyFrame(n / 120, n, (body,), 0.0, "test"))
        assert heard.next().frame == n
        sender.close()
        receiver.stop()
        receiver.stop()
    assert threading.active_count() == threads


def test_a_port_in_use_is_named(make: Make) -> None:
    receiver = make()
    receiver.start()
    try:
        port = port_of(receiver)
        with pytest.raises(ListenError, match=rf"{port}: Address already in use; choose a port that is free"):
            make(port).start()
    finally:
        receiver.stop()


@pytest.mark.parametrize("host", ["no-such-host.invalid", "300.1.1.1", "203.0.113.5"])
def test_an_address_that_this_machine_does_not_have_is_named(make: Make, host: str) -> None:
    with pytest.raises(ListenError, match=host):
        make(host=host).start()


def test_a_receiver_that_was_not_started_can_be_stopped(make: Make) -> None:
    make().stop()
