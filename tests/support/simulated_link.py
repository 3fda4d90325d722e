"""A network that loses, delays, reorders and duplicates packets, repeatably by a seed."""

import heapq
import itertools
import random
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import zmq

from manipnet.demo.player import connectable


@dataclass(frozen=True)
class LinkQuality:
    """How bad a network is: shares of packets in [0, 1] and times. The share `reorder` is delayed by `held_s` more."""

    loss: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    reorder: float = 0.0
    duplicate: float = 0.0
    held_s: float = 0.03

    def __str__(self) -> str:
        return (
            f"{100 * self.loss:g} % loss, {1e3 * self.delay_s:g} ± {1e3 * self.jitter_s:g} ms, "
            f"{100 * self.reorder:g} % reordered, {100 * self.duplicate:g} % duplicated"
        )


class Link:
    """Decides the fate of each packet, with random numbers of its own."""

    def __init__(self, quality: LinkQuality, seed: int) -> None:
        self._quality, self._random = quality, random.Random(seed)

    def delays_s(self) -> list[float]:
        """The delays after which to deliver the next packet: none for a lost one, two for a duplicated one."""
        quality, rng = self._quality, self._random
        lost, doubled, held = (rng.random() < share for share in (quality.loss, quality.duplicate, quality.reorder))
        delays = [
            max(quality.delay_s + rng.uniform(-quality.jitter_s, quality.jitter_s) + held * quality.held_s, 0.0)
            for _ in range(2)
        ]
        return [] if lost else delays[: 1 + doubled]


class Proxy:
    """Forwards messages through a link, on its own threads, from construction to `close`.

    `receive` waits a short time for a message and returns None when none came; only one thread calls `send`.
    """

    def __init__(
        self, quality: LinkQuality, seed: int, receive: Callable[[], bytes | None], send: Callable[[bytes], object]
    ) -> None:
        self.passed = self.lost = 0
        self.blackhole = False
        """While this is set, no message gets through."""
        self._link, self._receive, self._send = Link(quality, seed), receive, send
        self._waiting: list[tuple[float, int, bytes]] = []
        self._order = itertools.count()
        self._changed, self._stopping = threading.Condition(), threading.Event()
        self._threads = [threading.Thread(target=run, daemon=True) for run in (self._take, self._deliver)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop; messages that are still delayed are lost."""
        self._stopping.set()
        with self._changed:
            self._changed.notify()
        for thread in self._threads:
            thread.join()

    def _take(self) -> None:
        while not self._stopping.is_set():
            message = self._receive()
            if message is None:
                continue
            now_s = time.monotonic()
            delays = self._link.delays_s()
            if self.blackhole or not delays:
                self.lost += 1
                continue
            self.passed += 1
            with self._changed:
                for delay_s in delays:
                    heapq.heappush(self._waiting, (now_s + delay_s, next(self._order), message))
                self._changed.notify()

    def _deliver(self) -> None:
        while not self._stopping.is_set():
            with self._changed:
                due_s = self._waiting[0][0] if self._waiting else time.monotonic() + 1.0
                if due_s > time.monotonic():
                    self._changed.wait(due_s - time.monotonic())
                    continue
                message = heapq.heappop(self._waiting)[2]
            if not self.blackhole:
                self._send(message)


class UdpProxy(Proxy):
    """Forwards datagrams from `address` to `target` (`udp://HOST:PORT`), all from one source port."""

    def __init__(self, target: str, quality: LinkQuality, seed: int) -> None:
        self._inside = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._inside.bind(("127.0.0.1", 0))
        self._inside.settimeout(0.05)
        self._outside = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._outside.connect(connectable(target.replace("udp:", "tcp:")))
        self.address = f"udp://127.0.0.1:{self._inside.getsockname()[1]}"
        super().__init__(quality, seed, self._read, self._outside.send)

    def close(self) -> None:
        super().close()
        self._inside.close()
        self._outside.close()

    def _read(self) -> bytes | None:
        try:
            return self._inside.recv(65_536)
        except TimeoutError:
            return None


class ZmqProxy(Proxy):
    """Forwards body messages from a PUB socket that connects to `address` to `target` (`tcp://HOST:PORT`).

    A network cannot lose or reorder data inside TCP; this simulates what relays and senders on bad links do to whole
    messages.
    """

    def __init__(self, target: str, quality: LinkQuality, seed: int) -> None:
        self._context = zmq.Context()
        self._inside, self._outside = self._context.socket(zmq.SUB), self._context.socket(zmq.XPUB)
        for side in (self._inside, self._outside):
            side.setsockopt(zmq.LINGER, 0)
        self._inside.subscribe(b"")
        self._inside.bind("tcp://127.0.0.1:0")
        self.address = self._inside.getsockopt_string(zmq.LAST_ENDPOINT)
        self._outside.connect(target)
        if not self._outside.poll(10_000):
            raise TimeoutError(f"nobody subscribes at {target}")
        super().__init__(quality, seed, self._read, self._outside.send)

    def close(self) -> None:
        super().close()
        self._context.destroy()

    def _read(self) -> bytes | None:
        return self._inside.recv() if self._inside.poll(50) else None
