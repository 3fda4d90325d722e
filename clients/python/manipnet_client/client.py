"""The client: a reader thread that keeps the newest frame, reconnects, and counts frames."""

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
"""The first pause before a new attempt to connect, which doubles up to the limit."""


@dataclass(frozen=True)
class Stats:
    """The state and the counters of a client.

    `received` counts readable frames, `late` those of them that came too late to be shown, `refused` frames that could
    not be read, and `lost` frames that never arrived. `seq` is the number of the newest frame, and `age_s` the time
    since it arrived. `transit_s` is the time from its publication to its arrival, which is meaningful only if server
    and client share a clock.
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
    """Receives the hands of one actor (the first seen, if None) from `tcp://HOST:PORT`.

    With `hand`, they are those of the avatar whose profile has this name; `ControlClient.upload_hand` uploads one.

    `delay_s` is how far behind the newest frame `sample` shows the hands. `keys` names the file that
    `manipnet keys make NAME` wrote, for a server that requires keys; it needs pyzmq. The client is a context manager;
    otherwise call `close`. Any thread may call the methods. Raises `ValueError` for a wrong address or a wrong file of
    keys.
    """

    def __init__(
        self,
        address: str,
        actor: str | None = None,
        delay_s: float = 0.1,
        keys: str | PathLike[str] | None = None,
        hand: str | None = None,
    ) -> None:
        self._topic = layout.TOPIC if hand is None else f"hand/{hand}/bin ".encode()
        self._open = _opener(address, self._topic, keys)
        self._actor = actor
        self._changed = threading.Condition()
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
        with self._changed:
            self._changed.notify_all()
        self._thread.join()

    @property
    def newest(self) -> Hands | None:
        """The newest frame, or None before the first one."""
        return self._newest

    def wait(self, after: Hands | None = None, timeout_s: float | None = None) -> Hands | None:
        """Wait for a newer frame than `after` and return it; None after `timeout_s` or when the client is closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._newest is not after or self._stopping.is_set(), timeout_s)
            return None if self._newest is after or self._stopping.is_set() else self._newest

    def sample(self, now_s: float | None = None) -> Shown | None:
        """The interpolated hands to show at `now_s` (default: `time.monotonic()`), or None before the first frame."""
        with self._changed:
            return self._interpolator.sample(time.monotonic() if now_s is None else now_s)

    def stats(self) -> Stats:
        """The present state, counters and rates."""
        with self._changed:
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
        if not frame.startswith(self._topic):
            return
        try:
            hands = decode(frame[len(self._topic) :])
        except MessageError as error:
            self._set(state=f"message refused: {error}", refused=self._stats.refused + 1)
            return
        with self._changed:
            if (self._actor or hands.actor) != hands.actor:
                return
            self._actor = hands.actor
            self._accept(hands, arrival_s)
            self._changed.notify_all()

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
        with self._changed:
            self._stats = replace(self._stats, **changes)  # type: ignore[arg-type]


def _opener(
    address: str, topic: bytes, keys: str | PathLike[str] | None
) -> Callable[[], Subscription | SecureSubscription]:
    """A function that makes a connection; raises `ValueError` for a wrong address or a wrong file of keys."""
    where = (*parse_address(address), topic, layout.MAX_PAYLOAD_BYTES)
    if keys is None:
        return partial(Subscription, *where)
    from .curve import SecureSubscription, read_keys  # pyzmq is needed only with keys

    return partial(SecureSubscription, *where, read_keys(keys))
