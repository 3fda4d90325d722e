"""What a running server costs the programs beside it: processor time per second of stream, wake-ups and memory."""

import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import msgpack
import zmq

from manipnet.inputs.playback import ZmqBodySender, play
from manipnet_tools.bench.live import Served, serving
from manipnet_tools.bench.machine import resident_mb
from manipnet_tools.bench.process_cost import own_memory_mb, usage
from manipnet_tools.bench.scenarios import Scenario, actor_names, body_prefix, endless

SETTLE_S: Final = 2.0
"""Time after the first frame that is not measured, because the model's window fills in it."""
_SUBSCRIBE = """
import sys, zmq
socket = zmq.Context().socket(zmq.SUB)
socket.subscribe(b"pose/msgpack")
socket.connect(sys.argv[1])
while True:
    socket.recv()
"""


@dataclass(frozen=True)
class Case:
    """One way to use a server; each differs from the first in one thing."""

    name: str
    actors: int = 1
    rate_hz: float = 120.0
    """Frames of bodies per second; with 0, nothing is sent."""
    subscribed: bool = True
    recorded: bool = False


CASES: Final = (
    Case("one actor, 120 Hz"),
    Case("idle", rate_hz=0.0),
    Case("nobody subscribed", subscribed=False),
    Case("recording", recorded=True),
    Case("240 Hz", rate_hz=240.0),
    Case("360 Hz", rate_hz=360.0),
    Case("2 actors", actors=2),
    Case("8 actors", actors=8),
    Case("16 actors", actors=16),
)


@dataclass(frozen=True)
class Cost:
    """What a server and its child processes used per second of stream, and the server's memory in MB."""

    processor: float
    """Cores: seconds of processor time per second."""
    wake_ups: float
    """Per second."""
    own_mb: float
    resident_mb: float | None


def cost_of(case: Case, model: str, scenario: Scenario, seconds: float) -> Cost:
    """Serve one case for a number of seconds. Raises `ServeError`, and `OSError` on a system without /proc."""
    with ExitStack() as opened:
        folder = Path(opened.enter_context(tempfile.TemporaryDirectory(prefix="manipnet-cost-")))
        rig = folder / "stage.toml"
        rig.write_text(rig_text(scenario, case.actors), encoding="utf-8")
        server = opened.enter_context(serving(model, {}, 0.5, options=["--rig", str(rig), "--takes", str(folder)]))
        if case.subscribed:
            opened.enter_context(_subscriber(server.addresses["hands"]))
        if case.rate_hz:
            opened.enter_context(_sender(server, scenario, case.actors))
        if case.recorded:
            _ask(server, {"op": "record", "name": "cost"})
        time.sleep(SETTLE_S)
        before, start_s = usage(server.process.pid), time.monotonic()
        time.sleep(seconds)
        after, spent_s = usage(server.process.pid), time.monotonic() - start_s
        return Cost(
            (after.processor_s - before.processor_s) / spent_s,
            (after.wake_ups - before.wake_ups) / spent_s,
            own_memory_mb(server.process.pid),
            resident_mb(server.process.pid),
        )


def rig_text(scenario: Scenario, actors: int) -> str:
    """A rig file with the bodies that `endless` sends for a number of actors."""
    lines = []
    for name in actor_names(actors):
        prefix = body_prefix(name, actors)
        lines += ["[[actors]]", f'name = "{name}"', "[actors.bodies]"]
        lines += [f'{wrist} = "{prefix}{wrist}"' for wrist in ("left_wrist", "right_wrist")]
        for thing, path in scenario.meshes.items():
            lines += ["[[actors.objects]]", f'body = "{prefix}{thing}"', f'mesh = "{path.as_posix()}"']
    return "\n".join(lines) + "\n"


@contextmanager
def _subscriber(address: str) -> Iterator[None]:
    process = subprocess.Popen([sys.executable, "-c", _SUBSCRIBE, address])
    try:
        yield
    finally:
        process.kill()
        process.wait()


@contextmanager
def _sender(server: Served, scenario: Scenario, actors: int) -> Iterator[None]:
    host, _, port = server.addresses["bodies"].removeprefix("tcp://").rpartition(":")
    sender, stopping = ZmqBodySender(host, int(port)), threading.Event()
    thread = threading.Thread(target=play, args=(endless(scenario, actors), sender), kwargs={"stopping": stopping})
    thread.start()
    try:
        yield
    finally:
        stopping.set()
        thread.join()
        sender.close()


def _ask(server: Served, request: dict[str, Any]) -> None:
    with zmq.Context() as context, context.socket(zmq.REQ) as control:
        control.connect(server.addresses["control"])
        control.send(msgpack.packb(request))
        answer = msgpack.unpackb(control.recv())
        if "error" in answer:
            raise RuntimeError(answer["error"])
