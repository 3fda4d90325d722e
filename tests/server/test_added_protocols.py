"""A protocol is added by one file and one entry in a tuple: everything else follows from its declaration."""

import json
import socket
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from live_server import free_ports, scene, serving

from manipnet import cli, inputs, outputs
from manipnet.common.options import ConfigError
from manipnet.config.rig_reader import parse_rig
from manipnet_tools import cli as tools_cli
from manipnet_tools.assets.doc_tables import TABLES
from manipnet_tools.doctor import command as doctor
from manipnet_tools.doctor import examination

TOY_INPUT = '''
"""Tracked bodies as JSON datagrams, carried by pigeons."""

import json
from dataclasses import dataclass
from functools import partial

from manipnet.common.options import Choice, Port, option
from manipnet.inputs.declaration import Input, Receiver, Reception
from manipnet.net.supervised import ReceiverHealth
from manipnet.net.udp import UdpThread, bind_udp
from manipnet.wire.bodies import MessageError, parse_bodies


@dataclass(frozen=True)
class PigeonOptions:
    pigeon_port: int = option(7007, Port(), "UDP port where pigeons land")
    breed: str = option("homing", Choice(("homing", "tumbler")), "breed of the pigeons")


class Pigeons(Receiver):
    def __init__(self, options: PigeonOptions, reception: Reception) -> None:
        self._intake, self._host, self._port = reception.intake, reception.host, options.pigeon_port
        self._thread: UdpThread | None = None
        self.address = f"pigeon://{self._host}:{self._port}"

    def start(self) -> None:
        udp = bind_udp(self._host, self._port)
        self.address = "pigeon://%s:%d" % udp.getsockname()
        reopen = partial(bind_udp, *udp.getsockname())
        health = ReceiverHealth(self._intake.protocol, self._intake.telemetry)
        self._thread = UdpThread(udp, reopen, self._receive, lambda now_s: 0.1, lambda count: None, health)
        self._thread.start()

    def stop(self) -> None:
        if self._thread is not None:
            self._thread.stop()

    def _receive(self, datagram: bytes, sender: tuple[str, int], now_s: float) -> None:
        try:
            self._intake.accept(parse_bodies(datagram, now_s, f"pigeon:{sender[1]}"))
        except MessageError as error:
            self._intake.drop("lost_feather", f"pigeon:{sender[1]}", error)


class PigeonPlayer:
    def __init__(self, host: str, port: int) -> None:
        print("a pigeon flies to", host, port)

    def send(self, frame) -> None: ...

    def close(self) -> None: ...


PIGEON = Input(
    "pigeon",
    "Pigeons: each carries a datagram",
    PigeonOptions,
    Pigeons,
    drop_reasons=("lost_feather",),
    transport="udp",
    player=PigeonPlayer,
)
'''

TOY_OUTPUT = '''
"""Hands as smoke signals: one datagram for each message, with the actor's name and the number of hands."""

import json
import socket
from dataclasses import dataclass

from manipnet.common.options import Endpoint, HostPort, option
from manipnet.outputs.declaration import EncodedHands, Emission, HandsOutput, Output


@dataclass(frozen=True)
class SmokeOptions:
    smoke: Endpoint | None = option(None, HostPort(7008), "send smoke signals to that hill")


class Smoke(HandsOutput):
    def __init__(self, options: SmokeOptions, emission: Emission) -> None:
        self._hill = options.smoke
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, hands: EncodedHands) -> bool:
        signal = {"actor": hands.message.actor, "hands": len(hands.message.hands)}
        self._socket.sendto(json.dumps(signal).encode(), self._hill)
        return True

    def close(self) -> None:
        self._socket.close()


SMOKE = Output("smoke", "Smoke signals, for hills", SmokeOptions, Smoke)
'''

ADDED = """
import sys
from manipnet import cli, inputs, outputs
from toy_input import PIGEON
from toy_output import SMOKE
inputs.INPUTS += (PIGEON,)
outputs.OUTPUTS += (SMOKE,)
sys.exit(cli.main())
"""


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Both protocols, added to this process; and a server to which they are added, as the path of its program."""
    (tmp_path / "toy_input.py").write_text(TOY_INPUT)
    (tmp_path / "toy_output.py").write_text(TOY_OUTPUT)
    (tmp_path / "added.py").write_text(ADDED)
    monkeypatch.syspath_prepend(str(tmp_path))
    from toy_input import PIGEON  # pyright: ignore[reportMissingImports]
    from toy_output import SMOKE  # pyright: ignore[reportMissingImports]

    monkeypatch.setattr(inputs, "INPUTS", (*inputs.INPUTS, PIGEON))
    monkeypatch.setattr(outputs, "OUTPUTS", (*outputs.OUTPUTS, SMOKE))
    yield tmp_path / "added.py"
    del sys.modules["toy_input"], sys.modules["toy_output"]


LEAST = "[bodies]\nleft_wrist = 1\n"


def test_its_options_are_flags_rig_keys_and_printed(program: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = " ".join(cli.build_parser().format_help().split())
    assert "--pigeon-port PORT UDP port where pigeons land (default: 7007)" in text
    assert "--breed {homing,tumbler} breed of the pigeons (default: homing)" in text
    assert "--smoke HOST[:7008] send smoke signals to that hill" in text
    assert "--pigeon-port=0" in free_ports()
    rig = parse_rig(LEAST + "[server]\npigeon_port = 9\nsmoke = 'hill'\n", Path(), "rig.toml")
    assert rig.server == {"pigeon_port": 9, "smoke": ("hill", 7008)}
    assert cli.main(["--breed", "tumbler", "--smoke", "hill:9", "--print-config"]) == 0
    printed = capsys.readouterr().out
    assert "pigeon_port = 7007" in printed
    assert 'breed = "tumbler"' in printed
    assert 'smoke = "hill:9"' in printed


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("pigeon_port = -1", "rig.toml:4: server.pigeon_port is -1; it must be a port number"),
        ("breed = 'crow'", "rig.toml:4: server.breed is 'crow'; it must be one of homing, tumbler"),
        ("smoke = 'hill:0'", "rig.toml:4: server.smoke is 'hill:0'; it must be HOST or HOST:PORT"),
    ],
)
def test_a_wrong_value_is_refused_with_its_line(program: Path, line: str, complaint: str) -> None:
    with pytest.raises(ConfigError) as error:
        parse_rig(f"{LEAST}[server]\n{line}\n", Path(), "rig.toml")
    assert complaint in str(error.value)


def test_the_documentation_has_its_rows(program: Path) -> None:
    assert "| `breed` | `--breed {homing,tumbler}` | `homing` | breed of the pigeons |" in TABLES["options"]()
    row = "| Pigeons: each carries a datagram | `udp://127.0.0.1:7007` | `--pigeon-port` | `pigeon` |"
    assert row in TABLES["inputs"]()
    assert "| Smoke signals, for hills | 7008 | `--smoke` | `smoke` |" in TABLES["outputs"]()


def a_message(t_s: float) -> bytes:
    bodies = [{"name": name, "p": pose[:3], "q": pose[3:]} for name, pose in scene(t_s).items() if pose is not None]
    return json.dumps({"t": t_s, "bodies": bodies}).encode()


class Flight:
    """Pigeons that fly to a port in a thread, at 120 Hz, until the end of the block. Every tenth has lost a feather."""

    def __init__(self, port: int) -> None:
        self._port, self._stopping = port, threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
            for i in range(100_000):
                udp.sendto(a_message(i / 120) if i % 10 else b"no feather", ("127.0.0.1", self._port))
                if self._stopping.wait(1 / 120):
                    return


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def test_doctor_and_rig_init_listen_to_it(
    program: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(examination, "ANSWER_S", 0.1)
    port = free_port(socket.SOCK_DGRAM)
    ports = ["--input-port=0", "--osc-port=0", f"--pigeon-port={port}"]
    with Flight(port):
        control = f"--server=127.0.0.1:{free_port(socket.SOCK_STREAM)}"
        assert doctor.main([*ports, control, "--seconds=1"]) == 1
        output = capsys.readouterr().out
        names = ["--left-wrist=left_wrist", "--right-wrist=right_wrist"]
        assert tools_cli.main(["rig", "init", str(tmp_path / "rig.toml"), *ports, *names, "--seconds=0.3"]) == 0
    assert f"listening for 1 s on pigeon://127.0.0.1:{port}" in output
    assert "with the bodies 'left_wrist', 'right_wrist', 'Box'" in output
    assert "dropped as lost_feather: " in output
    assert "; pigeon:" in output
    written = (tmp_path / "rig.toml").read_text()
    assert f"pigeon_port = {port}" in written
    assert 'body = "Box"' in written


def test_replay_plays_to_it(program: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from manipnet_tools.commands.replay import connect

    connect("pigeon://loft")
    assert "a pigeon flies to loft 7007" in capsys.readouterr().out
    with pytest.raises(ConfigError, match=r"must be tcp://HOST:PORT or osc://HOST:PORT or pigeon://HOST:PORT"):
        connect("crow://loft")


def test_bodies_really_come_in_and_hands_really_go_out(program: Path, tiny_bundle: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as hill:
        hill.bind(("127.0.0.1", 0))
        hill.settimeout(60.0)
        options = ["--model", str(tiny_bundle), "--look-ahead", "0", "--smoke", f"127.0.0.1:{hill.getsockname()[1]}"]
        with serving(*options, program=[str(program)]) as server:
            _, _, port = server.addresses["pigeon"].rpartition(":")
            with Flight(int(port)):
                assert json.loads(hill.recv(1000)) == {"actor": "actor", "hands": 2}
            status = server.ask({"op": "status"})
    counters = status["counters"]
    assert counters["frames_in"]["pigeon"] > 0
    assert counters["frames_dropped"]["lost_feather"] > 0
    assert counters["messages_out"]["smoke"] > 0
    assert any(source.startswith("pigeon:") for source in status["senders"])
