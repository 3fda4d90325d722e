"""A network that loses, delays, reorders and doubles: by a seed, so that every run meets the same bad luck."""

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
class Weather:
    """Shares of packets in [0, 1], times in seconds. `reorder` holds back that share by `held_s` more."""

    loss: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    reorder: float = 0.0
    duplicate: float = 0.0
    held_s: float = 0.03

    def __str__(self) -> str:
        return (
            f"{100 * self.loss:g} % loss, {1e3 * self.delay_s:g} ± {1e3 * self.jitter_s:g} ms, "
            f"{100 * self.reorder:g} % reordered, {100 * self.duplicate:g} % doubled"
        )


class Link:
    """Decides packet by packet. Pure but for its own random numbers."""

    def __init__(self, weather: Weather, seed: int) -> None:
        self._weather, self._random = weather, random.Random(seed)

    def delays_s(self) -> list[float]:
        """When to deliver the next packet, counted from its arrival: never, once, or twice."""
        weather, rng = self._weather, self._random
        lost, doubled, held = (rng.random() < share for share in (weather.loss, weather.duplicate, weather.reorder))
        delays = [
            max(weather.delay_s + rng.uniform(-weather.jitter_s, weather.jitter_s) + held * weather.held_s, 0.0)
            for _ in range(2)
        ]
        return [] if lost else delays[: 1 + doubled]


class Proxy:
    """Passes messages on through a link, in threads of its own, from construction to `close`.

    `receive` waits a short time for a message and returns None without one; `send` is called in one thread only.
    """

    def __init__(
        self, weather: Weather, seed: int, receive: Callable[[], bytes | None], send: Callable[[bytes], object]
    ) -> None:
        self.passed = self.lost = 0
        self.blackhole = False
        """While set, nothing gets through."""
        self._link, self._receive, self._send = Link(weather, seed), receive, send
        self._waiting: list[tuple[float, int, bytes]] = []
        self._order = itertools.count()
        self._news, self._stopping = threading.Condition(), threading.Event()
        self._threads = [threading.Thread(target=run, daemon=True) for run in (self._take, self._deliver)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop; what is on its way is lost."""
        self._stopping.set()
        with self._news:
            self._news.notify()
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
            with self._news:
                for delay_s in delays:
                    heapq.heappush(self._waiting, (now_s + delay_s, next(self._order), message))
                self._news.notify()

    def _deliver(self) -> None:
        while not self._stopping.is_set():
            with self._news:
                due_s = self._waiting[0][0] if self._waiting else time.monotonic() + 1.0
                if due_s > time.monotonic():
                    self._news.wait(due_s - time.monotonic())
                    continue
                message = heapq.heappop(self._waiting)[2]
            if not self.blackhole:
                self._send(message)


class UdpProxy(Proxy):
    """Datagrams sent to `address` reach `target` (`udp://HOST:PORT`), all from one source."""

    def __init__(self, target: str, weather: Weather, seed: int) -> None:
        self._inside = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._inside.bind(("127.0.0.1", 0))
        self._inside.settimeout(0.05)
        self._outside = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._outside.connect(connectable(target.replace("udp:", "tcp:")))
        self.address = f"udp://127.0.0.1:{self._inside.getsockname()[1]}"
        super().__init__(weather, seed, self._read, self._outside.send)

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
    """Body messages sent to `address` by a PUB that connects reach `target` (`tcp://HOST:PORT`).

    Over TCP a network cannot lose or reorder; this does what relays and senders on bad links do to whole messages.
    """

    def __init__(self, target: str, weather: Weather, seed: int) -> None:
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
        super().__init__(weather, seed, self._read, self._outside.send)

    def close(self) -> None:
        super().close()
        self._context.destroy()

    def _read(self) -> bytes | None:
        return self._inside.recv() if self._inside.poll(50) else None
