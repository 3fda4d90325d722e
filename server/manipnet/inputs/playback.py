"""Plays body frames through real sockets in real time, as a tracker would send them.

Deadlines are absolute, so delays do not add up, and no frame is sent before the receiver listens.
"""

import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Protocol

import msgpack
import zmq

from manipnet.inputs.osc.writer import osc_datagrams
from manipnet.net.curve_keys import ClientKeys
from manipnet.net.zmq_socket import connect, tcp_address
from manipnet.wire.bodies import BodyFrame, bodies_map

CONNECT_S: Final = 10.0
"""How long to wait for a receiver to answer, or to read on when it has fallen behind."""

WAITING_FRAMES: Final = 1_000
"""Frames that may wait for a receiver that has fallen behind."""


class PlayError(OSError):
    """Nothing receives what is played. The text names the address and the remedy."""


class BodySender(Protocol):
    """Sends body frames to one receiver."""

    def send(self, frame: BodyFrame) -> None: ...

    def close(self) -> None: ...


class ZmqBodySender:
    """Sends msgpack messages through a publishing socket that connects to the receiver."""

    def __init__(
        self, host: str, port: int, stopping: threading.Event | None = None, keys: ClientKeys | None = None
    ) -> None:
        """Connect, with the `keys` that the receiver may require, and wait until it has subscribed.

        Raises `PlayError` if it has not within `CONNECT_S`, or when `stopping` is set.
        """
        self._context = zmq.Context()
        address = tcp_address((host, port))
        try:
            # XPUB also receives the subscriptions. What is sent before the first one would be lost.
            self._socket = connect(self._context, zmq.XPUB, (host, port), keys, high_water_mark=WAITING_FRAMES)
        except zmq.ZMQError as error:
            self._context.term()
            raise PlayError(f"cannot connect to {address}: {zmq.strerror(error.errno or 0)}") from None
        self._socket.setsockopt(zmq.LINGER, 1_000)
        self._socket.setsockopt(zmq.XPUB_NODROP, 1)
        self._socket.setsockopt(zmq.SNDTIMEO, int(1e3 * CONNECT_S))
        try:
            if not self._subscribed(stopping):
                raise PlayError(
                    f"nothing receives bodies at {address}; is the server running, and is that its --input-port?"
                )
        except BaseException:
            self.close()
            raise

    def send(self, frame: BodyFrame) -> None:
        """Send one message; wait if the receiver has fallen behind. Raises `PlayError` if it stays behind."""
        try:
            self._socket.send(msgpack.packb(bodies_map(frame)) or b"")
        except zmq.Again:
            raise PlayError(f"the receiver has not read anything for {CONNECT_S:g} s") from None

    def close(self) -> None:
        """Send what still waits, for at most a second, and disconnect."""
        self._socket.close()
        self._context.term()

    def _subscribed(self, stopping: threading.Event | None) -> bool:
        give_up_s = time.monotonic() + CONNECT_S
        while time.monotonic() < give_up_s and not (stopping is not None and stopping.is_set()):
            if self._socket.poll(50):
                return True
        return False


class OscBodySender:
    """Sends each frame as one OSC bundle, or as several between start and end if one would be too large."""

    def __init__(self, host: str, port: int) -> None:
        """Raises `PlayError` if the host has no known address."""
        try:
            family, _, _, _, self._address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        except OSError as error:
            raise PlayError(f"{host!r} is not an address or a known name ({error.strerror or error})") from None
        self._socket = socket.socket(family, socket.SOCK_DGRAM)

    def send(self, frame: BodyFrame) -> None:
        """Send one frame. It is lost if nothing receives it. Raises `MessageError` for a name that OSC cannot carry."""
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
    """How playing went: the number of frames, the time it took, and the largest delay of a frame."""

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
    """Send each frame at its time `t_s`, played `speed` times as fast, until the last frame or until `stopping`.

    `sent` is called after each frame.
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
    """The frames, repeated without end. Times and frame numbers keep rising; the usual interval joins end and start."""
    if not frames:
        return
    intervals = sorted(b.t_s - a.t_s for a, b in pairwise(frames))
    length_s = frames[-1].t_s - frames[0].t_s + (intervals[len(intervals) // 2] if intervals else 1.0)
    shift_s, number = 0.0, 0
    while True:
        for frame in frames:
            yield frame._replace(t_s=frame.t_s + shift_s, frame=number)
            number += 1
        shift_s += length_s
