"""Plays body frames through real sockets at their own time, as a tracker would send them.

Deadlines are absolute, so lateness never adds up, and no frame leaves before the receiver listens.
"""

import ipaddress
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, Protocol

import msgpack
import zmq

from manipnet.inputs.osc.writer import osc_datagrams
from manipnet.wire.bodies import BodyFrame, bodies_map

CONNECT_S: Final = 10.0
"""How long a receiver may take to answer, or to read on when it is behind."""


class PlayError(OSError):
    """Nobody to play to; the text names the address and what to do."""


class BodySender(Protocol):
    """Sends frames to one receiver."""

    def send(self, frame: BodyFrame) -> None: ...

    def close(self) -> None: ...


class ZmqBodySender:
    """A PUB socket that connects; the constructor waits until the receiver has subscribed."""

    def __init__(self, host: str, port: int, stopping: threading.Event | None = None) -> None:
        """Raises `PlayError` when nobody subscribes within `CONNECT_S`, or once `stopping` is set."""
        self._context = zmq.Context()
        # XPUB is PUB that also hears of subscriptions: what is sent before the first one is lost.
        self._socket = self._context.socket(zmq.XPUB)
        self._socket.setsockopt(zmq.LINGER, 1_000)
        self._socket.setsockopt(zmq.XPUB_NODROP, 1)
        self._socket.setsockopt(zmq.SNDTIMEO, int(1e3 * CONNECT_S))
        self._socket.setsockopt(zmq.IPV6, int(":" in host))
        address = f"tcp://{_bracketed(host)}:{port}"
        try:
            self._socket.connect(address)
            if not self._subscribed(stopping):
                raise PlayError(f"nobody listens for bodies at {address}; is the server running, and its --input-port?")
        except zmq.ZMQError as error:
            self.close()
            raise PlayError(f"{address} cannot be connected to: {zmq.strerror(error.errno or 0)}") from None
        except BaseException:
            self.close()
            raise

    def send(self, frame: BodyFrame) -> None:
        """One msgpack message; waits for a receiver that is behind. Raises `PlayError` when it stays so."""
        try:
            self._socket.send(msgpack.packb(bodies_map(frame)) or b"")
        except zmq.Again:
            raise PlayError(f"the receiver has read nothing for {CONNECT_S:g} s") from None

    def close(self) -> None:
        """Send what is still waiting, for a second at most, and disconnect."""
        self._socket.close()
        self._context.term()

    def _subscribed(self, stopping: threading.Event | None) -> bool:
        give_up_s = time.monotonic() + CONNECT_S
        while time.monotonic() < give_up_s and not (stopping is not None and stopping.is_set()):
            if self._socket.poll(50):
                return True
        return False


class OscBodySender:
    """Sends each frame as one OSC bundle, or as several between start and end where one would be too large."""

    def __init__(self, host: str, port: int) -> None:
        """Raises `PlayError` for a host without an address."""
        try:
            family, _, _, _, self._address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        except OSError as error:
            raise PlayError(f"{host!r} is no address or known name ({error.strerror or error})") from None
        self._socket = socket.socket(family, socket.SOCK_DGRAM)

    def send(self, frame: BodyFrame) -> None:
        """One frame; a receiver that is gone loses it, as UDP does. Raises `MessageError` for an impossible name."""
        for datagram in osc_datagrams(frame):
            try:
                self._socket.sendto(datagram, self._address)
            except ConnectionError:
                return

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


@dataclass(frozen=True)
class Played:
    """What a performance came to: frames sent, how long it took, and the latest any frame was."""

    frames: int
    seconds: float
    worst_late_s: float

    @property
    def rate_hz(self) -> float:
        """Frames per second."""
        return (self.frames - 1) / self.seconds if self.seconds > 0.0 else 0.0


def play(
    frames: Iterable[BodyFrame],
    sender: BodySender,
    speed: float = 1.0,
    stopping: threading.Event | None = None,
    sent: Callable[[Played], None] = lambda so_far: None,
) -> Played:
    """Send every frame when its time `t_s` has come, `speed` times as fast; until the end or until `stopping`.

    `sent` hears how it stands after every frame.
    """
    stopping = stopping or threading.Event()
    begin_s, first_s = time.monotonic(), None
    so_far = Played(0, 0.0, 0.0)
    for frame in frames:
        first_s = frame.t_s if first_s is None else first_s
        due_s = begin_s + (frame.t_s - first_s) / speed
        if stopping.wait(max(due_s - time.monotonic(), 0.0)):
            break
        sender.send(frame)
        now_s = time.monotonic()
        so_far = Played(so_far.frames + 1, now_s - begin_s, max(so_far.worst_late_s, now_s - due_s))
        sent(so_far)
    return so_far


def looped(frames: Sequence[BodyFrame]) -> Iterator[BodyFrame]:
    """The frames over and over; time and frame numbers go on rising, one usual interval from end to start."""
    if not frames:
        return
    intervals = sorted(b.t_s - a.t_s for a, b in pairwise(frames))
    length_s = frames[-1].t_s - frames[0].t_s + (intervals[len(intervals) // 2] if intervals else 1.0)
    shift_s, number = 0.0, 0
    while True:
        for frame in frames:
            yield replace(frame, t_s=frame.t_s + shift_s, frame=number)
            number += 1
        shift_s += length_s


def _bracketed(host: str) -> str:
    try:
        return f"[{host}]" if ipaddress.ip_address(host).version == 6 else host
    except ValueError:
        return host
