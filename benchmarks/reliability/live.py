"""A performance on a real server: somebody plays, somebody watches."""

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
    """Bodies to `tcp://…`, once the server has subscribed."""
    return ZmqBodySender(*connectable(address))


def osc_sender(address: str) -> OscBodySender:
    """Bodies to `udp://…`."""
    return OscBodySender(*connectable(address.replace("udp:", "tcp:")))


@contextmanager
def playing(frames: Iterable[BodyFrame], sender: BodySender) -> Iterator[threading.Thread]:
    """Play in a thread, until the frames end or the block does."""
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
class Watched:
    """Every hands message of one subscriber with its arrival, `time.monotonic` seconds."""

    arrived_s: list[float] = field(default_factory=list)
    messages: list[HandsMessage] = field(default_factory=list)

    def since(self, start_s: float, end_s: float = np.inf) -> "Watched":
        """What arrived from `start_s` until before `end_s`."""
        kept = [i for i, at_s in enumerate(self.arrived_s) if start_s <= at_s < end_s]
        return Watched([self.arrived_s[i] for i in kept], [self.messages[i] for i in kept])

    def intervals_s(self) -> np.ndarray:
        """Between publications `(n - 1,)`."""
        return np.diff([message.t_publish for message in self.messages])

    def transit_s(self) -> np.ndarray:
        """From published to received `(n,)`."""
        return np.array(self.arrived_s) - [message.t_publish for message in self.messages]

    def largest_steps(self) -> tuple[float, float]:
        """Between two messages in a row: of a joint's angle, radians, and of a joint in the world, metres."""
        turns, ways = [0.0], [0.0]
        for a, b in zip(self.messages, self.messages[1:], strict=False):
            for side in a.hands.keys() & b.hands.keys():
                one, two = a.hands[side], b.hands[side]
                turns.append(float(np.abs(two.angles - one.angles).max()))
                ways.append(float(np.linalg.norm(two.joints[:, :3] - one.joints[:, :3], axis=1).max()))
        return max(turns), max(ways)


@contextmanager
def watching(address: str, topic: bytes = TOPIC_MSGPACK) -> Iterator[Watched]:
    """A subscriber on a thread of its own, connected when the block begins."""
    watched, stopping = Watched(), threading.Event()
    with zmq.Context() as context:
        socket = context.socket(zmq.SUB)
        socket.setsockopt(zmq.RCVHWM, 0)
        monitor = socket.get_monitor_socket(zmq.EVENT_HANDSHAKE_SUCCEEDED)
        socket.subscribe(topic)
        socket.connect(address)
        connected = monitor.poll(10_000)
        socket.disable_monitor()
        monitor.close()
        thread = threading.Thread(target=_watch, args=(socket, topic, watched, stopping), daemon=True)
        thread.start()
        try:
            if not connected:
                raise TimeoutError(f"nobody publishes at {address}")
            yield watched
        finally:
            stopping.set()
            thread.join()


def _watch(socket: zmq.Socket, topic: bytes, watched: Watched, stopping: threading.Event) -> None:
    with socket:
        while not stopping.is_set():
            if socket.poll(50):
                message = socket.recv()
                arrived_s = time.monotonic()
                watched.messages.append(decode_msgpack(message[len(topic) :]))
                watched.arrived_s.append(arrived_s)
