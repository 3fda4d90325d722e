"""Talks nonsense to every TCP port of a running server, from several threads.

Each conversation comes from a random generator of its own, which the seed, the port and a number determine, so that it
can be repeated alone.
"""

import itertools
import os
import socket
import struct
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Final
from urllib.parse import urlsplit

from fuzz_http import http_talk
from fuzz_zmtp import zmtp_talk
from live_server import LiveServer

ZEROMQ_PORTS: Final = ("hands", "bodies", "control")
HTTP_PORTS: Final = ("page", "web", "metrics")
THREADS: Final = 3
LISTEN_S: Final = 0.05
"""How long a conversation waits for an answer to each of its parts."""
LINGER_S: Final = 0.5
"""How long a conversation that neither closes nor resets its connection keeps it open."""


@dataclass
class Outcome:
    """The number of conversations at each port, and of those that could not begin since the port did not answer."""

    talks: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)


def talk_of(seed: int, port: str, number: int, host: str, subprotocol: str) -> tuple[list[bytes], str]:
    """The parts of one conversation, and how it ends: "close", "reset", "half" (closed for sending) or "open"."""
    rng = Random(f"{seed}/{port}/{number}")
    over_http = port in HTTP_PORTS or rng.random() < 0.3
    parts = http_talk(rng, host.encode(), subprotocol.encode()) if over_http else zmtp_talk(rng)
    return parts, rng.choice(("close", "close", "reset", "half", "open"))


@contextmanager
def talking(server: LiveServer, seed: int, subprotocol: str) -> Iterator[Outcome]:
    """Talk nonsense to all ports until the end of the block."""
    outcome, stopping, numbers = Outcome(), threading.Event(), itertools.count()

    def run() -> None:
        while not stopping.is_set():
            number = next(numbers)
            port = (*ZEROMQ_PORTS, *HTTP_PORTS)[number % 6]
            address = urlsplit(server.addresses[port])
            try:
                _talk(
                    address.hostname or "", address.port or 0, *talk_of(seed, port, number, address.netloc, subprotocol)
                )
            except OSError:
                outcome.refused[port] += 1
            outcome.talks[port] += 1

    threads = [threading.Thread(target=run, daemon=True) for _ in range(THREADS)]
    for thread in threads:
        thread.start()
    try:
        yield outcome
    finally:
        stopping.set()
        for thread in threads:
            thread.join()


def _talk(host: str, port: int, parts: list[bytes], ending: str) -> None:
    """Hold one conversation. Raises `OSError` if the port cannot be reached."""
    with socket.create_connection((host, port), timeout=10.0) as connection, suppress(OSError):
        connection.settimeout(LISTEN_S)
        for part in parts:
            connection.sendall(part)
            with suppress(TimeoutError):
                if not connection.recv(65_536):
                    return
        match ending:
            case "reset":
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            case "half":
                connection.shutdown(socket.SHUT_WR)
                connection.recv(65_536)
            case "open":
                connection.settimeout(LINGER_S)
                connection.recv(65_536)


def busiest_thread(process: int, seconds: float) -> float:
    """The share of a core that the busiest thread of a process uses during so many seconds."""
    before = _thread_times_s(process)
    time.sleep(seconds)  # the length of the measurement
    after = _thread_times_s(process)
    return max(after[thread] - before[thread] for thread in before.keys() & after.keys()) / seconds


def _thread_times_s(process: int) -> dict[str, float]:
    times: dict[str, float] = {}
    for task in (Path("/proc") / str(process) / "task").iterdir():
        with suppress(OSError):  # the thread has ended
            fields = (task / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
            times[task.name] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return times
