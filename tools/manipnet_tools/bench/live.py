"""Measures a real `manipnet-serve` process over its sockets: start, memory, and delay of its hands."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

import msgpack
import numpy as np
import trimesh
import zmq

from manipnet.inputs.playback import ZmqBodySender, play
from manipnet.wire import TOPIC_MSGPACK
from manipnet.wire.bodies import BodyFrame
from manipnet_tools.bench.machine import resident_mb
from manipnet_tools.bench.scenarios import Scenario, endless
from manipnet_tools.bench.shapes import gourd

START_S = 300.0
"""Allows for a start that compiles everything on a busy machine."""
SETTLE_S = 1.0
"""Hands of this first time do not count, because the model's window is not full yet."""
QUIET_S = 1.0
"""When no hands arrive for this long after the last body, all have arrived."""
TOLERANCE_S = 1e-6
_PORTS = ("port", "input-port", "control-port", "osc-port", "page-port", "web-port", "trigger-port")


class ServeError(RuntimeError):
    """The server did not start, or stopped sending; the text quotes its error."""


@dataclass(frozen=True)
class Served:
    """A server that is ready: its process, its addresses by what they carry, and how long it took to start."""

    process: subprocess.Popen[str]
    addresses: Mapping[str, str]
    ready_s: float


@contextmanager
def serving(
    model: str,
    meshes: Mapping[str, Path],
    look_ahead_s: float,
    cache: Path | None = None,
    options: Sequence[str] = (),
) -> Iterator[Served]:
    """Run `manipnet-serve` on free ports, with its own `cache` folder if one is given. Raises `ServeError`."""
    options = [*(f"--{port}=0" for port in _PORTS), *options]
    options += [word for name, path in meshes.items() for word in ("--mesh", f"{name}={path}")]
    command = [sys.executable, "-m", "manipnet.cli", *options, "--model", model, "--look-ahead", str(look_ahead_s)]
    environment = os.environ | ({"MANIPNET_CACHE": str(cache)} if cache else {})
    with tempfile.TemporaryFile("w+") as errors:
        start_s = time.monotonic()
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True, env=environment)
        watchdog = threading.Timer(START_S, process.kill)
        watchdog.start()
        try:
            assert process.stdout is not None
            words = process.stdout.readline().split()
            ready_s = time.monotonic() - start_s
            watchdog.cancel()
            if words[:1] != ["ready"]:
                errors.seek(0)
                raise ServeError(f"the server did not get ready: {errors.read().strip() or 'it printed no error'}")
            reader = threading.Thread(target=_drain, args=(process.stdout,), daemon=True)
            reader.start()
            yield Served(process, dict(zip(words[1::2], words[2::2], strict=True)), ready_s)
        finally:
            watchdog.cancel()
            process.send_signal(signal.SIGTERM)
            with suppress(subprocess.TimeoutExpired):
                process.wait(10.0)
            process.kill()
            process.wait()
            if process.stdout is not None:
                process.stdout.close()


@dataclass(frozen=True)
class Starts:
    """Seconds until a server is ready, and its resident MB, with an empty cache (cold) and with a full one (warm)."""

    cold_s: float
    warm_s: float
    cold_mb: float | None
    warm_mb: float | None


def starts(model: str, triangles: int = 5000) -> Starts:
    """Start a server on one prop twice, the first time with an empty cache."""
    folder = Path(tempfile.mkdtemp(prefix="manipnet-bench-"))
    try:
        mesh = gourd(triangles)
        path = folder / "gourd.ply"
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
        seconds, sizes = [], []
        for _ in range(2):
            with serving(model, {"gourd": path}, 0.5, folder / "cache") as server:
                seconds.append(server.ready_s)
                sizes.append(resident_mb(server.process.pid))
        return Starts(*seconds, *sizes)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@dataclass(frozen=True)
class EndToEnd:
    """Seconds `(n,)` from the last packet that a tick needs to its hands, and `(n - 1,)` between publications."""

    look_ahead_s: float
    latency_s: np.ndarray
    interval_s: np.ndarray
    missing: int
    resident_mb: float | None


class TimedSender(ZmqBodySender):
    """A sender that keeps the time at which each frame was passed to the socket, on the monotonic clock."""

    def __init__(self, host: str, port: int) -> None:
        super().__init__(host, port)
        self.sent: list[tuple[float, float]] = []

    def send(self, frame: BodyFrame) -> None:
        self.sent.append((frame.t_s, time.monotonic()))
        super().send(frame)


def end_to_end(model: str, scenario: Scenario, look_ahead_s: float, seconds: float) -> EndToEnd:
    """Play a scenario to a server in real time, and receive its hands on the same machine."""
    with serving(model, scenario.meshes, look_ahead_s) as server:
        received, sent = _perform(server, scenario, SETTLE_S + seconds + look_ahead_s)
        size = resident_mb(server.process.pid)
    counted = [hands for hands in received if hands.t_capture_s >= SETTLE_S]
    if len(counted) < 2:
        raise ServeError(f"only {len(received)} hands messages arrived within {seconds:g} s")
    return EndToEnd(
        look_ahead_s,
        _latencies(counted, sent, look_ahead_s),
        np.diff([hands.t_publish_s for hands in counted]),
        counted[-1].seq - counted[0].seq + 1 - len(counted),
        size,
    )


@dataclass(frozen=True, slots=True)
class ReceivedHands:
    """The times of a hands message, and when it arrived."""

    seq: int
    t_capture_s: float
    t_publish_s: float
    at_s: float


def _read(payload: bytes, at_s: float) -> ReceivedHands:
    message = msgpack.unpackb(payload)
    return ReceivedHands(message["seq"], message["t_capture"], message["t_publish"], at_s)


def _perform(
    server: Served, scenario: Scenario, seconds: float
) -> tuple[list[ReceivedHands], list[tuple[float, float]]]:
    host, _, port = server.addresses["bodies"].removeprefix("tcp://").rpartition(":")
    frames = takewhile(lambda frame: frame.t_s <= seconds, endless(scenario))
    received: list[ReceivedHands] = []
    with zmq.Context() as context, context.socket(zmq.SUB) as hands:
        hands.setsockopt(zmq.RCVHWM, 0)
        hands.setsockopt(zmq.RCVTIMEO, int(1e3 * (QUIET_S + SETTLE_S)))
        hands.subscribe(TOPIC_MSGPACK)
        hands.connect(server.addresses["hands"])
        sender = TimedSender(host, int(port))
        thread = threading.Thread(target=_play, args=(frames, sender))
        thread.start()
        try:
            # the server goes on sending held hands after the last frame, so the end of the player ends the loop
            while thread.is_alive():
                with suppress(zmq.Again):
                    received.append(_read(hands.recv()[len(TOPIC_MSGPACK) :], time.monotonic()))
        finally:
            thread.join()
            sender.close()
    return received, sender.sent


def _play(frames: Iterable[BodyFrame], sender: TimedSender) -> None:
    play(frames, sender)


def _latencies(messages: Iterable[ReceivedHands], sent: list[tuple[float, float]], look_ahead_s: float) -> np.ndarray:
    """Seconds from sending the first frame that completes the look-ahead of a tick until its hands arrive."""
    times_s, passed_s = np.array(sent).T
    latencies = []
    for hands in messages:
        needed = int(np.searchsorted(times_s, hands.t_capture_s + look_ahead_s - TOLERANCE_S))
        if needed < len(times_s):
            latencies.append(hands.at_s - passed_s[needed])
    return np.array(latencies)


def _drain(lines: Iterable[str]) -> None:
    with suppress(ValueError):  # the pipe is closed at the end
        for _ in lines:
            pass
