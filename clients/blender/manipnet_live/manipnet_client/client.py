"""The connection: a reader thread that keeps the newest frame, reconnects, and counts what it sees."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING

from . import layout
from .interpolation import Interpolator, Shown
from .message import Hands, MessageError, decode
from .zmtp import Subscription, parse_address

if TYPE_CHECKING:
    from .curve import SecureSubscription

BACK_OFF_S, BACK_OFF_LIMIT_S = 0.1, 1.0


@dataclass(frozen=True)
class Stats:
    """What a status line shows.

    `received` frames arrived; of these, `late` ones came too late to be shown, and `refused` ones could not be
    read. `lost` frames never arrived. `seq`: the newest frame's number. `age_s`: time since it arrived. `transit_s`:
    how long it was on its way, which means something only where server and client share a clock.
    """

    state: str = "connecting"
    received: int = 0
    lost: int = 0
    late: int = 0
    refused: int = 0
    connections: int = 0
    seq: int = 0
    rate_hz: float = 0.0
    age_s: float = float("inf")
    transit_s: float = 0.0


class Client:
    """Receives the hands of one actor (the first seen, unless named) from `tcp://host:port`.

    `keys` names the file of `manipnet keys make NAME`, for a server that asks for one; it needs pyzmq. Use as a context
    manager, or call `close`. All methods may be called from any thread. Raises `ValueError` for an address or a file of
    keys that is none.
    """

    def __init__(
        self, address: str, actor: str | None = None, delay_s: float = 0.1, keys: str | PathLike[str] | None = None
    ) -> None:
        self._open = _opener(address, keys)
        self._actor = actor
        self._news = threading.Condition()
        self._interpolator = Interpolator(delay_s)
        self._newest: Hands | None = None
        self._newest_at = 0.0
        self._last: tuple[str | None, int] = (None, 0)
        self._arrivals: deque[float] = deque(maxlen=layout.RATE_HZ)
        self._stats = Stats()
        self._subscription: Subscription | SecureSubscription | None = None
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="manipnet-client", daemon=True)
        self._thread.start()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop the reader thread and wait for it."""
        self._stopping.set()
        if subscription := self._subscription:
            subscription.interrupt()
        with self._news:
            self._news.notify_all()
        self._thread.join()

    @property
    def newest(self) -> Hands | None:
        """The newest frame, or None before the first."""
        return self._newest

    def wait(self, after: Hands | None = None, timeout_s: float | None = None) -> Hands | None:
        """The newest frame once it is another than `after`; None when time is up or the client is closed."""
        with self._news:
            self._news.wait_for(lambda: self._newest is not after or self._stopping.is_set(), timeout_s)
            return None if self._newest is after or self._stopping.is_set() else self._newest

    def sample(self, now_s: float | None = None) -> Shown | None:
        """What to show now (`time.monotonic()` unless told), interpolated; None before the first frame."""
        with self._news:
            return self._interpolator.sample(time.monotonic() if now_s is None else now_s)

    def stats(self) -> Stats:
        """Counters and rates as of now."""
        with self._news:
            times, now = self._arrivals, time.monotonic()
            recent = [t for t in times if now - t < 1.0]
            rate = (len(recent) - 1) / (recent[-1] - recent[0]) if len(recent) > 1 else 0.0
            age = now - self._newest_at if self._newest else float("inf")
            return replace(self._stats, late=self._interpolator.late, rate_hz=rate, age_s=age)

    def _run(self) -> None:
        wait_s = BACK_OFF_S
        while not self._stopping.is_set():
            before = self._stats.received
            try:
                self._read()
            except OSError as error:
                self._set(state=f"reconnecting: {error}")
            wait_s = BACK_OFF_S if self._stats.received > before else min(2 * wait_s, BACK_OFF_LIMIT_S)
            self._stopping.wait(wait_s)
        self._set(state="closed")

    def _read(self) -> None:
        self._subscription = subscription = self._open()
        try:
            self._set(state="connected", connections=self._stats.connections + 1)
            for frames in subscription.batches():
                if self._stopping.is_set():
                    return
                for frame in frames:
                    self._take(frame, time.monotonic())
        finally:
            subscription.close()

    def _take(self, frame: bytes, arrival_s: float) -> None:
        if not frame.startswith(layout.TOPIC):
            return
        try:
            hands = decode(frame[len(layout.TOPIC) :])
        except MessageError as error:
            self._set(state=f"message refused: {error}", refused=self._stats.refused + 1)
            return
        with self._news:
            if (self._actor or hands.actor) != hands.actor:
                return
            self._actor = hands.actor
            self._accept(hands, arrival_s)
            self._news.notify_all()

    def _accept(self, hands: Hands, arrival_s: float) -> None:
        stats, (session, seq) = self._stats, self._last
        lost = max(hands.seq - seq - 1, 0) if session == hands.session else 0
        counted = {"received": stats.received + 1, "lost": stats.lost + lost, "seq": hands.seq}
        self._stats = replace(stats, state="connected", transit_s=arrival_s - hands.t_publish, **counted)
        self._last = (hands.session, hands.seq)
        self._arrivals.append(arrival_s)
        if self._interpolator.push(hands, arrival_s):
            self._newest, self._newest_at = hands, arrival_s

    def _set(self, **changes: object) -> None:
        with self._news:
            self._stats = replace(self._stats, **changes)  # type: ignore[arg-type]


def _opener(address: str, keys: str | PathLike[str] | None) -> Callable[[], Subscription | SecureSubscription]:
    """What makes a connection; raises `ValueError` where it never could."""
    where = (*parse_address(address), layout.TOPIC, layout.MAX_PAYLOAD_BYTES)
    if keys is None:
        return partial(Subscription, *where)
    from .curve import SecureSubscription, read_keys  # only who has keys needs pyzmq

    return partial(SecureSubscription, *where, read_keys(keys))
