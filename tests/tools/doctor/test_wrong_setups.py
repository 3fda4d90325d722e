"""What the doctor answers to wrong set-ups, over real sockets: the trouble, by name, and what to do about it."""

import json
import math
import re
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import pytest
import zmq
from fake_motive import FakeMotive
from live_server import LiveServer, serving
from natnet_writer import Body, Frame, server_info
from osc_streams import HZ, bodies, bridge, milliseconds, stream, transformation, vmc
from osc_writer import bundle, osc

from manipnet.runtime.run_file import running_servers
from manipnet_tools.doctor import command as doctor
from manipnet_tools.doctor import examination

RIG = """
[bodies]
left_wrist = 1
right_wrist = 2
[[objects]]
body = 3
mesh = "mug"
"""
SECONDS = 1.5


@dataclass
class Ports:
    """Free ports, and the options that make the doctor use them."""

    osc: int
    bodies: int
    control: int

    @property
    def options(self) -> list[str]:
        return [f"--osc-port={self.osc}", f"--input-port={self.bodies}", f"--server=127.0.0.1:{self.control}"]

    @property
    def of_server(self) -> list[str]:
        """The options that make a server use them."""
        return [f"--osc-port={self.osc}", f"--input-port={self.bodies}", f"--control-port={self.control}"]


@pytest.fixture
def ports(monkeypatch) -> Ports:
    monkeypatch.setattr(examination, "ANSWER_S", 0.2)
    with socket.socket() as tcp, socket.socket() as other, socket.socket(type=socket.SOCK_DGRAM) as udp:
        for made in (tcp, other, udp):
            made.bind(("127.0.0.1", 0))
        return Ports(udp.getsockname()[1], tcp.getsockname()[1], other.getsockname()[1])


@pytest.fixture
def rig(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(RIG)
    return path


# What runs beside the doctor: each is a context manager that may return more options for it.


@contextmanager
def over_osc(ports: Ports, *frames, seconds=60.0, hz=HZ) -> Iterator[list[str]]:
    """Senders of OSC, each with a socket of its own."""
    stopping = threading.Event()

    def until_stopped(frame):
        return lambda k: [] if stopping.is_set() else frame(k)

    threads = [
        threading.Thread(target=stream, args=(ports.osc, until_stopped(frame), seconds, hz), daemon=True)
        for frame in frames
    ]
    for thread in threads:
        thread.start()
    try:
        yield []
    finally:
        stopping.set()


@contextmanager
def over_zmq(ports: Ports, send: Callable[[zmq.Socket, int], object], kind=zmq.PUB) -> Iterator[list[str]]:
    """A sender over ZeroMQ."""
    stopping = threading.Event()

    def run():
        with zmq.Context() as context, context.socket(kind) as sender:
            sender.setsockopt(zmq.LINGER, 0)
            sender.setsockopt(zmq.SNDTIMEO, 0)
            sender.connect(f"tcp://127.0.0.1:{ports.bodies}")
            k = 0
            while not stopping.wait(1 / HZ):
                with suppress(zmq.Again):
                    send(sender, k)
                k += 1

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield []
    finally:
        stopping.set()
        thread.join()


@contextmanager
def motive(ports: Ports, frame=None, version=(3, 0), **options) -> Iterator[list[str]]:
    """A Motive that streams `frame(k)`, or nothing."""
    skeletons = options.pop("skeletons", {})
    stopping = threading.Event()
    with FakeMotive(version, **options) as fake:
        fake.skeletons = skeletons

        def run():
            k = 0
            while not stopping.wait(1 / HZ):
                if frame is not None:
                    made = frame(k)
                    made.number, made.timestamp_s = k, k / HZ
                    fake.send(made.write(version))
                k += 1

        thread = threading.Thread(target=run)
        thread.start()
        try:
            yield [f"--natnet=127.0.0.1:{fake.port}"]
        finally:
            stopping.set()
            thread.join()


@contextmanager
def nothing(ports: Ports, *options: str) -> Iterator[list[str]]:
    """Nobody."""
    yield list(options)


@contextmanager
def port_taken(ports: Ports) -> Iterator[list[str]]:
    """Another program on the OSC port."""
    with socket.socket(type=socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", ports.osc))
        yield []


@contextmanager
def closed_port(ports: Ports) -> Iterator[list[str]]:
    """A Motive's machine on which nothing answers."""
    with socket.socket(type=socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        yield [f"--natnet=127.0.0.1:{silent.getsockname()[1]}"]


def message(k, **changes):
    entries = [{"id": i, "p": list(p[:3]), "q": list(p[3:])} for i, p in bodies(k)]
    return json.dumps({"t": 100 + k / HZ, "bodies": entries} | changes).encode()


def moved(k, i, change):
    """Three VMC trackers, the pose of one of which is changed."""
    trackers = [osc("/VMC/Ext/Tra/Pos", str(n), *(change(p) if n == i else p)) for n, p in bodies(k)]
    return [bundle(osc("/VMC/Ext/T", k / HZ), *trackers)]


def on_stage(k, *more):
    return Frame(bodies=[*(Body(i, p[:3], p[3:]) for i, p in bodies(k)), *more], full=False)


NAMES = {1: "left_wrist", 2: "right_wrist", 3: "Box"}

SETUPS = {
    "nothing is sent": (nothing, [], "nothing arrives at all", "does it send to tcp://127.0.0.1"),
    "garbage over OSC": (
        over_osc,
        [lambda k: [b"garbage!"]],
        "are dropped as malformed",
        "see docs/protocol-in.md for what a message may contain",
    ),
    "addresses that nobody knows": (
        over_osc,
        [lambda k: [osc("/light/7/colour", 0.5)]],
        "sends /light/7/colour 1",
        "declare this one in the rig file",
    ),
    "the addresses of a bridge's matrices only": (
        over_osc,
        [lambda k: [osc("/rigidbody", 1, "matrix", *[0.0] * 16)]],
        "sends /rigidbody … matrix",
        "send one of the addresses in docs/protocol-in.md",
    ),
    "a body that is not sent": (
        over_osc,
        [lambda k: [bundle(*(osc("/VMC/Ext/Tra/Pos", str(i), *p) for i, p in bodies(k) if i != 2))]],
        "right_wrist: no body 2 arrives",
        "name one of these in the rig: 1, 3",
    ),
    "bodies with other names": (
        over_osc,
        [lambda k: [bundle(*(osc("/VMC/Ext/Tra/Pos", f"LHR-{i}", *p) for i, p in bodies(k)))]],
        "left_wrist: no body 1 arrives",
        "name one of these in the rig: 'LHR-1', 'LHR-2', 'LHR-3'",
    ),
    "a body that is never tracked": (
        over_osc,
        [lambda k: [bundle(*transformation(1, bodies(k)[0][1]), osc("/rigidbody/2/tracked", 0))]],
        "right_wrist: body 2 arrives but is never tracked",
        "it is occluded, outside of the volume or switched off",
    ),
    "two programs that send the same": (
        over_osc,
        [lambda k: [vmc(k)], lambda k: [vmc(k)]],
        "left_wrist: body 1 comes from 2 senders: osc:",
        "stop all senders of this body but one",
    ),
    "ten frames a second": (
        lambda ports, frame: over_osc(ports, frame, hz=10),
        [lambda k: [vmc(k, hz=10)]],
        "sends 10 frames per second",
        "send 30 to 360 frames per second",
    ),
    "positions without rotations": (
        over_osc,
        [lambda k: [bundle(*(osc(f"/rigidbody/{i}/position", *p[:3]) for i, p in bodies(k)))]],
        "body 1 is not used, because its rotation never arrives",
        "let the sender send the rotation too",
    ),
    "an avatar without trackers": (
        over_osc,
        [
            lambda k: [
                bundle(osc("/VMC/Ext/OK", 1), osc("/VMC/Ext/Bone/Pos", "LeftHand", *bodies(k)[0][1])),
            ]
        ],
        "sends /VMC/Ext/Bone/Pos 1",
        "let the sender send its trackers too: /VMC/Ext/Tra/Pos",
    ),
    "a bridge without bodies": (
        over_osc,
        [lambda k: [*bridge(k)[:2], osc("/frame/end", 9000 + k)]],
        "sends messages that are understood, but no pose of a body",
        "turn on rigid bodies, trackers or bones",
    ),
    "two bodies with one id over OSC": (
        over_osc,
        [lambda k: [vmc(k, extra=[osc("/VMC/Ext/Tra/Pos", "3", 2.0, 1.0, 2.0 + 1e-3 * k, 0.0, 0.0, 0.0, 1.0)])]],
        "two bodies have the key 3, so neither is used",
        "give each its own id or name",
    ),
    "a time that stands still, and no other": (
        over_osc,
        [lambda k: [osc("/frame/start", k), osc("/frame/timestamp", 7), *bridge(k)[2:]]],
        "its /frame/timestamp stands still, so the times of arrival are used",
        "send the time of each capture",
    ),
    "a time tag of milliseconds beside a good time": (
        over_osc,
        [lambda k: [bundle(*bridge(k), tag=milliseconds(k))]],
        "so /frame/timestamp gives the times",
        "",
    ),
    "a sender outside of the allowed networks": (
        lambda ports, frame: with_options(over_osc(ports, frame), "--allow=10.0.0.0/8"),
        [lambda k: [vmc(k)]],
        "are dropped as not_allowed",
        "add the sender's address with --allow",
    ),
    "millimetres": (
        over_osc,
        [lambda k: moved(k, 1, lambda p: (1200.0, 1300.0, 1100.0 + k % 7, *p[3:]))],
        "bodies are rejected as bounds",
        "send metres, not millimetres",
    ),
    "a pose of NaN": (
        over_osc,
        [lambda k: moved(k, 1, lambda p: (math.nan,) * 7)],
        "bodies are rejected as nan",
        "mark a lost body as not tracked instead",
    ),
    "a rotation of zeros": (
        over_osc,
        [lambda k: moved(k, 1, lambda p: (*p[:3], 0.0, 0.0, 0.0, 0.0))],
        "bodies are rejected as zero_quaternion",
        "mark a lost body as not tracked instead",
    ),
    "zeros for a lost body": (
        over_osc,
        [lambda k: moved(k, 1, lambda p: p if k // 60 % 2 == 0 else (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))],
        "bodies are rejected as zeros",
        "mark it as not tracked instead",
    ),
    "the OSC port is in use": (port_taken, [], "cannot listen on udp://127.0.0.1", "ss -lntup"),
    "an address of another machine": (
        nothing,
        ["--host=203.0.113.9"],
        "cannot listen on",
        "name an address of this machine: 127.0.0.1",
    ),
    "JSON with a mistake": (
        over_zmq,
        [lambda sender, k: sender.send(b'{"t": 1, "bodies": [}')],
        "are dropped as malformed",
        "see docs/protocol-in.md",
    ),
    "a topic in front of each message": (
        over_zmq,
        [lambda sender, k: sender.send_multipart([b"bodies", message(k)])],
        "the message has several frames; send one, without a topic in front",
        "see docs/protocol-in.md",
    ),
    "a t in milliseconds since 1970": (
        over_zmq,
        [lambda sender, k: sender.send(message(k, t=1.7e12 + 1000 * k / HZ))],
        "must be finite, in seconds (not milliseconds)",
        "see docs/protocol-in.md",
    ),
    "a t in milliseconds since the start": (
        over_zmq,
        [lambda sender, k: sender.send(message(k, t=1000 * k / HZ))],
        "its t jumps by 8.33 s from frame to frame, so the times of arrival are used",
        "t in seconds over ZeroMQ",
    ),
    "a t that is always zero": (
        over_zmq,
        [lambda sender, k: sender.send(message(k, t=0))],
        "its t stands still, so the times of arrival are used",
        "t in seconds over ZeroMQ",
    ),
    "a message of 100 kB": (
        over_zmq,
        [lambda sender, k: sender.send(b" " * 100_000)],
        "are dropped as oversized",
        "send one frame per message, with at most 64 KiB",
    ),
    "a PUSH socket": (
        lambda ports, send: over_zmq(ports, send, zmq.PUSH),
        [lambda sender, k: sender.send(message(k))],
        "because their sockets have the wrong type, for example PUSH",
        "send bodies from a PUB socket",
    ),
    "a tracker that does not answer": (
        nothing,
        ["--connect=tcp://127.0.0.1:9"],
        "no tracker answers at tcp://127.0.0.1:9",
        "does it bind a PUB socket there",
    ),
    "a Motive that does not answer": (closed_port, [], "Motive does not answer", "enable NatNet in Motive"),
    "a Motive that streams nothing": (
        motive,
        [None],
        "Motive answers but streams no frames",
        "choose Unicast as Transmission Type",
    ),
    "a Motive that streams multicast": (
        lambda ports: motive(ports, info=server_info(group="239.255.42.99")),
        [],
        "the server streams multicast: start with --multicast",
        "see docs/natnet.md",
    ),
    "a Motive that is too new": (
        lambda ports: motive(ports, info=server_info(version=(5, 1))),
        [],
        "speaks NatNet 5.1",
        "see docs/natnet.md",
    ),
    "two bodies with one id in Motive": (
        lambda ports: motive(ports, lambda k: on_stage(k, Body(3)), names=[*NAMES.items(), (3, "Stick")]),
        [],
        "'Box' and 'Stick' have the streaming id 3",
        "every rigid body needs its own name and its own streaming id",
    ),
    "two bodies with one name in Motive": (
        lambda ports: motive(ports, on_stage, names=[(1, "wrist"), (2, "wrist"), (3, "Box")]),
        [],
        "the streaming ids 1 and 2 have the name 'wrist'",
        "every rigid body needs its own name",
    ),
    "a Motive with a skeleton only": (
        lambda ports: motive(
            ports,
            lambda k: Frame(bodies=[], skeletons={5: [Body(9), Body(13)]}),
            names={},
            skeletons={5: ("Ann", {9: "LHand", 13: "RHand"})},
        ),
        [],
        "left_wrist: no body 1 arrives",
        "name one of these in the rig: 'Ann:LHand', 'Ann:RHand'",
    ),
    "a Motive with a skeleton that it does not name": (
        lambda ports: motive(ports, lambda k: Frame(bodies=[], skeletons={5: [Body(9), Body(13)]}), names={}),
        [],
        "Motive streams skeletons whose bones have no names, and no rigid bodies",
        "enable Skeletons in Motive's streaming settings",
    ),
    "a Motive without bodies": (
        lambda ports: motive(ports, lambda k: Frame(bodies=[], skeletons={}), names={}),
        [],
        "Motive streams frames, but defines no rigid bodies and no skeletons",
        "create rigid bodies for wrists and props",
    ),
}


@contextmanager
def with_options(beside, *options: str) -> Iterator[list[str]]:
    """The same, with more options for the doctor."""
    with beside as more:
        yield [*more, *options]


PAGE = Path(__file__).parents[3] / "docs" / "troubleshooting.md"
QUOTED = [
    quoted
    for cell in re.findall(r"^\| ([^|]*`[^|]*) \|", PAGE.read_text(encoding="utf-8"), re.M)
    for quoted in re.findall(r"`([^`]*)`", cell)
    if " " in quoted
]
"""What the page quotes of the doctor."""


def quotes(piece: str, line: str) -> bool:
    """Whether a line has what the page quotes, in which "…" stands for anything."""
    return re.search(".*".join(map(re.escape, piece.split("…"))), line) is not None


@pytest.mark.parametrize("name", SETUPS)
def test_the_trouble_is_named_with_its_remedy(name, ports, rig, capsys):
    beside, arguments, trouble, remedy = SETUPS[name]
    with beside(ports, *arguments) as options:
        status = doctor.main([*ports.options, f"--rig={rig}", f"--seconds={SECONDS}", *options])
    lines = capsys.readouterr().out.splitlines()
    at = next((i for i, line in enumerate(lines) if trouble in line), None)
    assert at is not None, "\n".join(lines)
    if remedy:
        assert status == 1
        assert lines[at].startswith("problem ")
        assert remedy in lines[at + 1]
    problems = [line for line in lines if line.startswith("problem ")]
    assert [line for line in problems if not any(quotes(piece, line) for piece in QUOTED)] == [], "troubleshooting.md"
    if name != "nothing is sent":
        assert "nothing arrives at all" not in "\n".join(lines) or beside in (nothing, port_taken, closed_port, motive)


def test_a_good_setup_has_no_problem(ports, rig, capsys):
    with over_osc(ports, lambda k: [vmc(k)]):
        assert doctor.main([*ports.options, f"--rig={rig}", f"--seconds={SECONDS}"]) == 0
    output = capsys.readouterr().out
    for part, key in (("left_wrist", 1), ("right_wrist", 2), ("3", 3)):
        assert re.search(
            rf"ok      {part}: body {key} is tracked in 100 % of 1?[0-9]+ frames per second from osc:", output
        )


def test_trackers_in_bundles_of_their_own_are_not_too_many_frames(ports, rig, capsys):
    def frame(k):
        trackers = [*bodies(k), *((i, bodies(k)[0][1]) for i in range(4, 9))]
        return [bundle(osc("/VMC/Ext/T", k / HZ), osc("/VMC/Ext/Tra/Pos", str(i), *p)) for i, p in trackers]

    with over_osc(ports, frame):
        assert doctor.main([*ports.options, f"--rig={rig}", f"--seconds={SECONDS}"]) == 0, capsys.readouterr().out


def test_a_sender_that_was_started_again_is_in_order(ports, rig, capsys):
    """The one before has another port, and its bodies come from the new one."""
    with over_osc(ports, lambda k: [vmc(k)] if k < HZ else [], lambda k: [vmc(k)] if k > 1.3 * HZ else []):
        assert doctor.main([*ports.options, f"--rig={rig}", "--seconds=4"]) == 0
    assert re.search(r"note    other senders now send the bodies of osc:\S+, which stopped", capsys.readouterr().out)


# The server that runs says the same


AGREEING = (
    "addresses that nobody knows",
    "a body that is not sent",
    "bodies with other names",
    "a body that is never tracked",
    "two programs that send the same",
    "positions without rotations",
    "an avatar without trackers",
    "a bridge without bodies",
    "two bodies with one id over OSC",
    "a time that stands still, and no other",
    "a pose of NaN",
    "garbage over OSC",
    "a t that is always zero",
)


def troubles(lines: list[str]) -> set[str]:
    """The problems without what differs from run to run: numbers, and the log line of the listening doctor."""
    problems = [line[8:].partition(";")[0] for line in lines if line.startswith("problem")]
    return {re.sub(r"#?\d+(\.\d+)?( ms)?", "N", line).replace("(most is lost as conflict)", "") for line in problems}


@pytest.mark.parametrize("name", AGREEING)
def test_the_running_server_and_the_listening_doctor_agree(name, ports, rig, tiny_bundle, capsys, monkeypatch):
    beside, arguments, trouble, _ = SETUPS[name]
    with ExitStack() as opened:
        options = opened.enter_context(beside(ports, *arguments))
        doctor.main([*ports.options, f"--rig={rig}", "--seconds=2.5", *options])
        listened = troubles(capsys.readouterr().out.splitlines())
        server: LiveServer = opened.enter_context(
            serving(f"--rig={rig}", "--model", str(tiny_bundle), *ports.of_server, *options)
        )
        monkeypatch.setattr(examination, "ANSWER_S", 20.0)
        for _ in range(40):
            doctor.main(ports.options)
            reported = troubles(capsys.readouterr().out.splitlines())
            if reported == listened:
                break
            threading.Event().wait(0.25)
        assert any(re.sub(r"#?\d+(\.\d+)?", "N", trouble) in line for line in listened)
        assert reported == listened, server.errors


def test_a_server_is_found_by_itself_and_its_answer_is_in_its_status(tiny_bundle, capsys, monkeypatch):
    monkeypatch.setattr(examination, "ANSWER_S", 20.0)
    with serving("--model", str(tiny_bundle)) as server:
        assert doctor.main([]) == 1  # the control port is a random one
        output = capsys.readouterr().out
        assert f"a server runs here (control {server.addresses['control'].removeprefix('tcp://')})" in output
        findings = server.ask({"op": "status"})["doctor"]
        assert any("nothing arrives at all" in finding["text"] for finding in findings)
        assert all(finding["remedy"] for finding in findings if finding["level"] == "problem")
    assert not running_servers()


def test_a_server_with_keys_says_what_is_missing(tiny_bundle, tmp_path, capsys, monkeypatch):
    from manipnet.net.curve_keys import make_server_keys

    make_server_keys(tmp_path)
    monkeypatch.setattr(examination, "ANSWER_S", 0.5)
    with serving("--model", str(tiny_bundle), f"--keys={tmp_path}"):
        assert doctor.main([]) == 1
    output = capsys.readouterr().out
    assert "does not answer to strangers, since it was started with --keys" in output
    assert "→ give --keys NAME.toml" in output
