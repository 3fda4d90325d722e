"""Senders that play bodies to a real server, and subscribers that record its hands."""

import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import zmq

from manipnet.demo.player import connectable
from manipnet.inputs.playback import BodySender, OscBodySender, ZmqBodySender, play
from manipnet.wire import TOPIC_MSGPACK, HandsMessage, decode_msgpack
from manipnet.wire.bodies import BodyFrame


def zmq_sender(address: str) -> ZmqBodySender:
    """A sender of bodies to `tcp://HOST:PORT`; returns when the server has subscribed."""
    return ZmqBodySender(*connectable(address))


def osc_sender(address: str) -> OscBodySender:
    """A sender of bodies to `udp://HOST:PORT`."""
    return OscBodySender(*connectable(address.replace("udp:", "tcp:")))


@contextmanager
def playing(frames: Iterable[BodyFrame], sender: BodySender) -> Iterator[threading.Thread]:
    """Play the frames on a thread until they end or the block does."""
    stopping = threading.Event()
    thread = threading.Thread(target=play, args=(frames, sender), kwargs={"stopping": stopping}, daemon=True)
    thread.start()
    try:
        yield thread
    finally:
        stopping.set()
        thread.join()
        sender.close()


@dataclass
class Received:
    """The hands messages of one subscriber, with their times of arrival in `time.monotonic` seconds."""

    arrived_s: list[float] = field(default_factory=list)
    messages: list[HandsMessage] = field(default_factory=list)

    def since(self, start_s: float, end_s: float = np.inf) -> "Received":
        """The messages that arrived from `start_s` until before `end_s`."""
        kept = [i for i, at_s in enumerate(self.arrived_s) if start_s <= at_s < end_s]
        return Received([self.arrived_s[i] for i in kept], [self.messages[i] for i in kept])

    def intervals_s(self) -> np.ndarray:
        """Times between publications `(n - 1,)`, seconds."""
        return np.diff([message.t_publish for message in self.messages])

    def next(self, seconds: float) -> "Received":
        """Wait for so many seconds and return the messages that arrive meanwhile."""
        start_s = time.monotonic()
        time.sleep(seconds)
        return self.since(start_s, start_s + seconds)

    def largest_steps(self) -> tuple[float, float]:
        """The largest changes between two messages in a row, of an angle in radians and of a joint in metres."""
        turns, distances = [0.0], [0.0]
        for a, b in zip(self.messages, self.messages[1:], strict=False):
            for side in a.hands.keys() & b.hands.keys():
                one, two = a.hands[side], b.hands[side]
                turns.append(float(np.abs(two.angles - one.angles).max()))
                distances.append(float(np.linalg.norm(two.joints[:, :3] - one.joints[:, :3], axis=1).max()))
        return max(turns), max(distances)


@contextmanager
def receiving(address: str) -> Iterator[Received]:
    """Record the hands of `pose/msgpack` on a thread; the subscriber is connected when the block begins."""
    received, stopping = Received(), threading.Event()
    with zmq.Context() as context:
        socket = context.socket(zmq.SUB)
        socket.setsockopt(zmq.RCVHWM, 0)
        monitor = socket.get_monitor_socket(zmq.EVENT_HANDSHAKE_SUCCEEDED)
        socket.subscribe(TOPIC_MSGPACK)
        socket.connect(address)
        connected = monitor.poll(10_000)
        socket.disable_monitor()
        monitor.close()
        thread = threading.Thread(target=_receive, args=(socket, received, stopping), daemon=True)
        thread.start()
        try:
            if not connected:
                raise TimeoutError(f"no publisher answers at {address}")
            yield received
        finally:
            stopping.set()
            thread.join()


def _receive(socket: zmq.Socket, received: Received, stopping: threading.Event) -> None:
    with socket:
        while not stopping.is_set():
            if socket.poll(50):
                message = socket.recv()
                arrived_s = time.monotonic()
                received.messages.append(decode_msgpack(message[len(TOPIC_MSGPACK) :]))
                received.arrived_s.append(arrived_s)
