"""Receivers outlive every error: a message that fails costs itself, and a socket that fails is opened again."""

import json
import os
import socket
import threading
import time

import msgpack
import pytest
import zmq
from fake_motive import FakeMotive
from live_server import PATIENCE_S
from natnet_writer import Frame
from osc_writer import bundle, osc
from publisher import message

from manipnet.control.dispatcher import Dispatcher
from manipnet.control.service import Control
from manipnet.inputs.natnet import NATNET
from manipnet.inputs.natnet.client import NatNetBodies
from manipnet.inputs.natnet.options import NatNetOptions
from manipnet.inputs.osc import OSC
from manipnet.inputs.osc.receiver import OscBodies
from manipnet.inputs.zeromq import ZEROMQ
from manipnet.inputs.zeromq.receiver import ZmqBodies
from manipnet.net.supervised import FIRST_PAUSE_S, LASTED_S, LONGEST_PAUSE_S, Pauses
from manipnet.outputs.declaration import EncodedHands
from manipnet.outputs.zeromq.publisher import ZmqPublisher
from manipnet.runtime.status import SecondLines, status
from manipnet.telemetry import Telemetry
from manipnet.wire import TOPIC_BIN

MESSAGE = msgpack.packb({"t": 1.0, "bodies": [{"id": 1, "p": [0, 0, 0], "q": [0, 0, 0, 1]}]}) or b""


def wait_for(condition) -> None:
    give_up_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < give_up_s
        threading.Event().wait(0.01)


def restarts(telemetry: Telemetry, name: str) -> int:
    return telemetry.receivers()[name]["restarts"]


def send_body(address: str) -> None:
    with zmq.Context() as context, context.socket(zmq.XPUB) as sender:
        sender.setsockopt(zmq.LINGER, 1_000)
        sender.connect(address)
        assert sender.poll(20_000)
        sender.send(MESSAGE)


def end_context(bound) -> None:
    """Let every call at a socket's context fail from now on, as a fault inside ZeroMQ would."""
    threading.Thread(target=bound._terminate, daemon=True).start()


def test_bodies_come_again_after_the_socket_has_failed(heard, telemetry):
    receiver = ZmqBodies(ZEROMQ.intake(heard, telemetry), port=0)
    receiver.start()
    try:
        for times in (1, 2):
            assert receiver._bound is not None
            end_context(receiver._bound)
            wait_for(lambda times=times: restarts(telemetry, "zmq") == times)
            send_body(receiver.address)
            assert heard.next().t_s == 1.0
    finally:
        receiver.stop()
    assert telemetry.counts()["receiver_restarts"] == {"zmq": 2}
    report = telemetry.receivers()["zmq"]
    assert report["state"] == "listening"
    assert "terminated" in report["error"].lower()


def test_a_receiver_that_is_down_is_reported_until_it_listens_again(heard, telemetry, caplog):
    receiver = ZmqBodies(ZEROMQ.intake(heard, telemetry), port=0)
    receiver.start()
    host, port = "127.0.0.1", int(receiver.address.rpartition(":")[2])
    assert receiver._bound is not None
    taken = socket.socket()
    taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)

    def take_port() -> bool:
        try:
            taken.bind((host, port))
            taken.listen()
            return True
        except OSError:
            return False

    end_context(receiver._bound)
    wait_for(take_port)
    wait_for(lambda: "in use" in (telemetry.receivers()["zmq"]["error"] or ""))
    assert status([], telemetry, 0.0)["receivers"]["zmq"]["state"] == "down"
    assert SecondLines([], telemetry).next(0.0).status.startswith("ZMQ IS DOWN | ")
    taken.close()
    wait_for(lambda: telemetry.receivers()["zmq"]["state"] == "listening")
    assert "DOWN" not in SecondLines([], telemetry).next(0.0).status
    send_body(receiver.address)
    assert heard.next().t_s == 1.0
    receiver.stop()
    assert "the socket has failed" in caplog.text


def test_stop_ends_a_receiver_that_is_down(heard, telemetry):
    receiver = ZmqBodies(ZEROMQ.intake(heard, telemetry), port=0)
    receiver.start()
    assert receiver._bound is not None
    end_context(receiver._bound)
    wait_for(lambda: telemetry.receivers()["zmq"]["error"])
    receiver.stop()


def test_osc_comes_again_after_its_descriptor_was_closed(heard, telemetry):
    receiver = OscBodies(OSC.intake(heard, telemetry), port=0)
    receiver.start()
    try:
        assert receiver._thread is not None
        os.close(receiver._thread.socket.fileno())
        wait_for(lambda: restarts(telemetry, "osc") == 1)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            packet = bundle(
                osc("/frame/start", 7), osc("/rigidbody/1/transformation", *(0.0,) * 6, 1.0), osc("/frame/end", 7)
            )
            sender.sendto(packet, ("127.0.0.1", int(receiver.address.rpartition(":")[2])))
        assert heard.next().frame == 7
    finally:
        receiver.stop()


def test_natnet_comes_again_after_its_descriptor_was_closed(heard, telemetry):
    with FakeMotive() as motive:
        receiver = NatNetBodies(NATNET.intake(heard, telemetry), NatNetOptions(("127.0.0.1", motive.port)))
        receiver.start()
        try:
            motive.wait_for(0)
            assert receiver._command is not None
            os.close(receiver._command.socket.fileno())
            wait_for(lambda: restarts(telemetry, "natnet") == 1)
            connected, give_up_s = motive.requests[0], time.monotonic() + PATIENCE_S
            while heard.frames.empty():  # the server knows the new socket once the client has connected again
                assert time.monotonic() < give_up_s, f"{motive.requests[0] - connected} requests to connect"
                motive.send(Frame(number=7).write((3, 0)))
                threading.Event().wait(0.05)
            assert heard.next().frame == 7
        finally:
            receiver.stop()
    assert telemetry.receivers()["natnet"]["state"] == "listening"


def ask(address: str, request: dict) -> dict:
    with zmq.Context() as context, context.socket(zmq.REQ) as client:
        client.setsockopt(zmq.LINGER, 0)
        client.connect(address)
        client.send(json.dumps(request).encode())
        assert client.poll(20_000), "no answer"
        return json.loads(client.recv())


def test_control_answers_again_after_its_socket_has_failed(telemetry):
    control = Control("127.0.0.1", 0, Dispatcher({"ping": lambda _: {"t": 1.0}}, telemetry), telemetry)
    control.start()
    try:
        for times in (1, 2):
            end_context(control._door.bound)
            wait_for(lambda times=times: restarts(telemetry, "control") == times)
            assert ask(control.address, {"op": "ping"}) == {"t": 1.0}
    finally:
        control.stop()


def test_a_request_whose_handling_fails_costs_only_itself(telemetry):
    dispatcher = Dispatcher({"ping": lambda _: {"t": 1.0}}, telemetry)
    submit = dispatcher.submit

    def fussy(parts, reply, here=True, ops=("ping",)):
        if b"bad" in parts[0]:
            raise RuntimeError("digest")
        submit(parts, reply, here, ops)

    dispatcher.submit = fussy
    control = Control("127.0.0.1", 0, dispatcher, telemetry)
    control.start()
    try:
        with zmq.Context() as context, context.socket(zmq.REQ) as client:
            client.setsockopt(zmq.LINGER, 0)
            client.connect(control.address)
            client.send(b"bad")
            wait_for(lambda: "frames_dropped" in telemetry.counts())
            assert ask(control.address, {"op": "ping"}) == {"t": 1.0}
    finally:
        control.stop()
    assert telemetry.counts()["frames_dropped"] == {"internal": 1}
    assert restarts(telemetry, "control") == 0


def test_hands_are_published_again_after_the_socket_has_failed(telemetry):
    publisher = ZmqPublisher(telemetry, "127.0.0.1", 0)
    hands = EncodedHands(message(0, 0.0, 0.1))
    try:
        end_context(publisher._bound)
        wait_for(lambda: not publisher.send(hands))
        assert telemetry.receivers()["hands"]["state"] == "down"
        wait_for(lambda: publisher.send(hands))
        with zmq.Context() as context, context.socket(zmq.SUB) as client:
            client.subscribe(TOPIC_BIN)
            client.connect(str(publisher.address))
            wait_for(lambda: publisher.send(hands) and client.poll(0))
            assert client.recv() == TOPIC_BIN + hands.binary
    finally:
        publisher.close()


def test_pauses_grow_until_a_socket_has_lasted():
    now_s = 0.0
    pauses = Pauses(lambda: now_s)
    pauses.opened()
    lengths = [pauses.next_s() for _ in range(8)]
    assert lengths[:3] == [FIRST_PAUSE_S, 2 * FIRST_PAUSE_S, 4 * FIRST_PAUSE_S]
    assert lengths[-1] == LONGEST_PAUSE_S
    pauses.opened()
    now_s += 0.5 * LASTED_S
    assert pauses.next_s() == LONGEST_PAUSE_S, "it failed again soon"
    pauses.opened()
    now_s += 2.0 * LASTED_S
    assert pauses.next_s() == FIRST_PAUSE_S


@pytest.mark.parametrize("fault", [ValueError("bad"), OSError("bad")])
def test_a_datagram_whose_handling_fails_costs_only_itself(heard, telemetry, fault):
    def fussy(frame):
        raise fault

    receiver = OscBodies(OSC.intake(fussy, telemetry), port=0)
    receiver.start()
    try:
        receiver._intake.accept = fussy
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            packet = bundle(
                osc("/frame/start", 7), osc("/rigidbody/1/transformation", *(0.0,) * 6, 1.0), osc("/frame/end", 7)
            )
            sender.sendto(packet, ("127.0.0.1", int(receiver.address.rpartition(":")[2])))
            wait_for(lambda: telemetry.counts().get("frames_dropped") == {"internal": 1})
            receiver._intake.accept = heard
            sender.sendto(packet, ("127.0.0.1", int(receiver.address.rpartition(":")[2])))
        assert heard.next().frame == 7
    finally:
        receiver.stop()
    assert restarts(telemetry, "osc") == 0
