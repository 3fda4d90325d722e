"""`manipnet doctor`: its reasoning, and the command over real sockets."""

import itertools
import socket
import threading

import msgpack
import pytest
import zmq
from fake_motive import FakeMotive

from manipnet.control.dispatcher import Dispatcher
from manipnet.control.service import Control
from manipnet.net.curve_keys import make_client_keys, make_server_keys, read_server_keys
from manipnet.telemetry import Telemetry
from manipnet_tools.doctor import command as doctor
from manipnet_tools.doctor import examination, listening, other_interfaces


@pytest.fixture
def ports(monkeypatch):
    monkeypatch.setattr(examination, "ANSWER_S", 0.1)
    with socket.socket() as tcp, socket.socket() as other, socket.socket(type=socket.SOCK_DGRAM) as udp:
        for made in (tcp, other, udp):
            made.bind(("127.0.0.1", 0))
        numbers = [made.getsockname()[1] for made in (tcp, udp, other)]
    names = ("--input-port", "--osc-port", "--server")
    return [
        f"{name}={'127.0.0.1:' if name == '--server' else ''}{number}"
        for name, number in zip(names, numbers, strict=True)
    ]


def port(ports, name):
    return int(next(p for p in ports if p.startswith(name)).partition("=")[2].rpartition(":")[2])


def test_nothing_arrives(ports, capsys):
    assert doctor.main([*ports, "--seconds=0.1"]) == 1
    assert "nothing arrives at all" in capsys.readouterr().out


def test_a_port_in_use(ports, capsys):
    with socket.socket(type=socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", port(ports, "--osc-port")))
        assert doctor.main([*ports, "--seconds=0.1"]) == 1
    output = capsys.readouterr().out
    assert "cannot listen on udp://" in output
    assert "ss -lntup" in output


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--host=203.0.113.9"], "name an address of this machine: 127.0.0.1"),
        (["--natnet=127.0.0.1", "--interface=203.0.113.9"], "name an address of this machine: 127.0.0.1"),
        (["--natnet=192.0.2.1", "--interface=127.0.0.1"], "cannot send to 192.0.2.1"),
    ],
)
def test_a_wrong_interface(ports, capsys, options, expected):
    assert doctor.main([*ports, "--seconds=0.2", *options]) == 1
    assert expected in capsys.readouterr().out


def test_packets_for_another_address_of_this_machine(ports, capsys, monkeypatch):
    monkeypatch.setattr(other_interfaces, "own_addresses", lambda: {"127.0.0.1", "127.0.0.2"})
    osc, bodies = (port(ports, name) for name in ("--osc-port", "--input-port"))

    def send(seconds, rehearsal):
        with socket.socket(type=socket.SOCK_DGRAM) as udp, socket.create_connection(("127.0.0.2", bodies)):
            for _ in range(3):
                udp.sendto(b"whatever", ("127.0.0.2", osc))

    monkeypatch.setattr(listening, "listen", send)
    assert doctor.main([*ports]) == 1
    output = capsys.readouterr().out
    assert f"3 packets or connections came to 127.0.0.2:{osc}, but the server listens on 127.0.0.1" in output
    assert f"1 packets or connections came to 127.0.0.2:{bodies}" in output
    assert "start the server with --host 127.0.0.2" in output


def test_a_server_with_keys_is_asked_with_a_key(ports, capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(examination, "ANSWER_S", 20.0)
    make_server_keys(tmp_path)
    path = make_client_keys(tmp_path, "stage-pc")
    handlers = {"status": lambda request: {"counters": {"frames_in": {"osc": 5}}, "actors": {}}}
    control = Control(
        "127.0.0.1",
        port(ports, "--server"),
        Dispatcher(handlers, Telemetry()),
        Telemetry(),
        read_server_keys(tmp_path),
    )
    control.start()
    assert doctor.main([*ports, f"--keys={path}"]) == 0
    control.stop()
    assert "frames that arrived: 5 by osc" in capsys.readouterr().out
    assert doctor.main([*ports, f"--keys={tmp_path / 'none.toml'}"]) == 1
    assert "none.toml: cannot be read" in capsys.readouterr().out


def test_bodies_that_arrive_are_compared_with_the_rig(ports, capsys):
    stop = threading.Event()

    def send():
        with zmq.Context() as context, context.socket(zmq.PUB) as publisher:
            publisher.setsockopt(zmq.LINGER, 0)
            publisher.connect(f"tcp://127.0.0.1:{port(ports, '--input-port')}")
            body = {"p": [0, 1, 0], "q": [0, 0, 0, 1]}
            for n in itertools.count():
                bodies = [{"name": "left_wrist", **body}, {"name": "rightwrist", **body}]
                publisher.send(msgpack.packb({"t": n / 120, "bodies": bodies}))
                if stop.wait(1 / 120):
                    return

    thread = threading.Thread(target=send)
    thread.start()
    assert doctor.main([*ports, "--seconds=1"]) == 1
    stop.set()
    thread.join()
    output = capsys.readouterr().out
    assert "left_wrist: body 'left_wrist' is tracked in 100 %" in output
    assert "right_wrist: no body 'right_wrist' arrives" in output
    assert "'rightwrist'" in output


@pytest.mark.parametrize(
    ("version", "expected"),
    [((3, 0), "answers but streams no frames"), ((2, 6), "speaks NatNet 2.6, and this program understands 2.7")],
)
def test_motive_that_answers(ports, capsys, version, expected):
    with FakeMotive(version, {1: "left_wrist"}) as motive:
        assert doctor.main([*ports, "--seconds=0.5", f"--natnet=127.0.0.1:{motive.port}"]) == 1
    assert expected in capsys.readouterr().out


def test_motive_that_does_not_answer(ports, capsys):
    with socket.socket(type=socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        assert doctor.main([*ports, "--seconds=0.1", f"--natnet=127.0.0.1:{silent.getsockname()[1]}"]) == 1
    assert "Motive does not answer" in capsys.readouterr().out


def test_a_wrong_rig_file_is_named(ports, tmp_path, capsys):
    assert doctor.main([*ports, f"--rig={tmp_path / 'none.toml'}"]) == 1
    assert "none.toml" in capsys.readouterr().out
