"""A real server in a process of its own, and a sender and a subscriber to talk to it over real sockets."""

import json
import math
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import msgpack
import numpy as np
import zmq

from manipnet.common.options import Port
from manipnet.config.settings import all_options
from manipnet.net.addresses import is_loopback
from manipnet.net.curve_keys import ClientKeys
from manipnet.net.zap import secure_client
from manipnet.wire import TOPIC_BIN, TOPIC_MSGPACK, HandsMessage, decode_binary, decode_msgpack

PATIENCE_S = 60.0
START_S = 300.0
"""The first start after a change compiles everything, perhaps on a busy machine."""
Bodies = Mapping[Any, Sequence[float] | np.ndarray | None]
"""Poses `(7,)` by name or id; None for a body that is not tracked."""
Poses = Callable[[float], Bodies]


def free_ports() -> list[str]:
    """Options with which a server takes any free port wherever it listens."""
    options = all_options().values()
    return [f"{each.flag}=0" for each in options if isinstance(each.kind, Port) and each.default is not None]


class LiveServer:
    """`manipnet-serve` on free ports, in a process of its own."""

    def __init__(
        self,
        *options: str,
        program: Sequence[str] = ("-m", "manipnet.cli"),
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """`environment` is added to that of the tests."""
        self.process = subprocess.Popen(
            [sys.executable, *program, *free_ports(), *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, **(environment or {})},
        )
        self.lines: queue.Queue[str] = queue.Queue()
        self.errors: list[str] = []
        self._threads = [
            threading.Thread(target=_forward, args=(self.process.stdout, self.lines.put), daemon=True),
            threading.Thread(target=_forward, args=(self.process.stderr, self.errors.append), daemon=True),
        ]
        for thread in self._threads:
            thread.start()
        self.addresses: dict[str, str] = {}

    def wait_ready(self) -> "LiveServer":
        line = self.lines.get(timeout=START_S)
        assert line.startswith("ready "), (line, self.errors)
        words = line.split()[1:]
        self.addresses = dict(zip(words[::2], words[1::2], strict=True))
        return self

    def line(self) -> str:
        """The next line on standard output, or an empty text if the server has ended."""
        return self.lines.get(timeout=PATIENCE_S)

    def ask(self, request: Any, as_json: bool = False, keys: ClientKeys | None = None) -> dict[str, Any]:
        """Send one control request. Returns the answer."""
        with zmq.Context() as context, context.socket(zmq.REQ) as req:
            req.setsockopt(zmq.LINGER, 0)
            if keys is not None:
                secure_client(req, keys)
            req.connect(self.addresses["control"])
            if not isinstance(request, bytes):
                request = json.dumps(request).encode() if as_json else msgpack.packb(request)
            req.send(request)
            assert req.poll(int(1e3 * PATIENCE_S)), "no answer"
            return json.loads(req.recv()) if as_json else msgpack.unpackb(req.recv())

    def stop(self, how: int = signal.SIGTERM) -> int:
        """Stop the server. Returns its exit status."""
        if self.process.poll() is None:
            self.process.send_signal(how)
        status = self.process.wait(PATIENCE_S)
        for thread in self._threads:
            thread.join(PATIENCE_S)
        return status


@contextmanager
def serving(*options: str, **how: Any) -> Iterator[LiveServer]:
    """A server that is ready; `how` goes to `LiveServer`. It is stopped at the end of the block."""
    server = LiveServer(*options, **how)
    try:
        yield server.wait_ready()
    finally:
        if server.process.poll() is None:
            server.stop(signal.SIGKILL if sys.exc_info()[0] else signal.SIGTERM)


class Sender:
    """Sends body messages. The constructor waits until the server has subscribed."""

    def __init__(self, address: str) -> None:
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.XPUB)
        self._socket.setsockopt(zmq.LINGER, 1000)
        self._socket.setsockopt(zmq.SNDHWM, 0)
        self._socket.connect(address)
        assert self._socket.poll(int(1e3 * PATIENCE_S)), "the server does not subscribe"
        self._socket.recv()

    def send(self, t_s: float, bodies: Bodies, **more: Any) -> None:
        """Send one frame of poses `(7,)` by name or id, with None for a body that is not tracked."""
        entries = []
        for key, pose in bodies.items():
            p, q = (list(pose[:3]), list(pose[3:])) if pose is not None else ([0.0] * 3, [0.0, 0.0, 0.0, 1.0])
            entries.append({"name" if isinstance(key, str) else "id": key, "p": p, "q": q, "tracked": pose is not None})
        self.send_raw(msgpack.packb({"t": t_s, "bodies": entries} | more))

    def send_raw(self, payload: bytes) -> None:
        self._socket.send(payload)

    def close(self) -> None:
        self._socket.close()
        self._context.term()


class Subscriber:
    """Collects hands messages in a thread, from the moment the constructor returns."""

    def __init__(self, address: str, topic: bytes = TOPIC_MSGPACK) -> None:
        self._topic, self._decode = topic, {TOPIC_MSGPACK: decode_msgpack, TOPIC_BIN: decode_binary}[topic]
        self._messages: queue.Queue[HandsMessage] = queue.Queue()
        self._stopping = threading.Event()
        self._context = zmq.Context()
        socket = self._context.socket(zmq.SUB)
        socket.setsockopt(zmq.RCVHWM, 0)
        monitor = socket.get_monitor_socket(zmq.EVENT_HANDSHAKE_SUCCEEDED)
        socket.subscribe(topic)
        socket.connect(address)
        assert monitor.poll(int(1e3 * PATIENCE_S)), "no connection"
        socket.disable_monitor()
        monitor.close()
        self._thread = threading.Thread(target=self._run, args=(socket,), daemon=True)
        self._thread.start()

    def next(self) -> HandsMessage:
        return self._messages.get(timeout=PATIENCE_S)

    def until(self, t_capture: float, actor: str | None = None) -> list[HandsMessage]:
        """The messages up to the first whose instant is `t_capture` or later."""
        messages = [self.next()]
        while messages[-1].t_capture < t_capture - 1e-6 or actor not in (None, messages[-1].actor):
            messages.append(self.next())
        return messages

    def close(self) -> None:
        self._stopping.set()
        self._thread.join(PATIENCE_S)
        self._context.term()

    def _run(self, socket: zmq.Socket) -> None:
        with socket:
            while not self._stopping.is_set():
                if socket.poll(50):
                    message = socket.recv()
                    assert message.startswith(self._topic)
                    self._messages.put(self._decode(message[len(self._topic) :]))


def own_address() -> str | None:
    """An address of this machine other than its loopback, or None if it has none. Nothing is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
        except OSError:
            return None
        address = probe.getsockname()[0]
    return None if is_loopback(address) else address


class Stage:
    """A server with a sender and a subscriber, for several performances one after another."""

    def __init__(self, server: LiveServer) -> None:
        self.server = server
        self.subscriber = Subscriber(server.addresses["hands"])
        self.sender = Sender(server.addresses["bodies"])
        self.start_s = 0.0

    def perform(self, seconds: float, poses: Poses, rate_hz: float = 120.0) -> list[HandsMessage]:
        """Send `poses(t)` in real time, with t from zero. Returns the hands messages of exactly that time."""
        self.start_s += 1000.0
        begin_s = time.monotonic()
        for i in range(round(seconds * rate_hz) + 1):
            time.sleep(max(begin_s + i / rate_hz - time.monotonic(), 0.0))
            self.sender.send(self.start_s + i / rate_hz, poses(i / rate_hz))
        messages: list[HandsMessage] = []
        since_s = -1.0
        while not messages or since_s < seconds - 1e-6:
            message = self.subscriber.next()
            since_s = message.t_capture - self.start_s
            if -1e-6 <= since_s <= seconds + 1e-6:
                messages.append(message)
        return messages

    def counted(self, name: str, value: str) -> int:
        """One of the server's counters."""
        return self.server.ask({"op": "status"})["counters"].get(name, {}).get(value, 0)

    def close(self) -> None:
        self.sender.close()
        self.subscriber.close()


def scene(t_s: float) -> dict[str, tuple[float, ...]]:
    """Two hands that hold a box between them and swing it."""
    x, turn = 0.05 * math.sin(3.0 * t_s), (0.0, math.sin(0.2 * t_s), 0.0, math.cos(0.2 * t_s))
    return {
        "left_wrist": (x + 0.14, 1.0, 0.05, *turn),
        "right_wrist": (x - 0.14, 1.0, 0.05, *turn),
        "Box": (x, 1.0, 0.0, *turn),
    }


def _forward(stream, put) -> None:
    with stream:
        for line in stream:
            put(line.rstrip("\n"))
    put("")
