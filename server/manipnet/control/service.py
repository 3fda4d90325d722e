"""Requests from clients: a ROUTER socket, which REQ sockets connect to, on a thread of its own."""

import threading
import time
from collections.abc import Callable
from typing import Final

import zmq

from manipnet.control.dispatcher import Dispatcher
from manipnet.net.addresses import is_loopback
from manipnet.net.curve_keys import ServerKeys
from manipnet.net.errors import ListenError
from manipnet.net.rate_limit import Throttle
from manipnet.net.supervised import ReceiverHealth, SupervisedThread
from manipnet.net.zmq_socket import BoundSocket
from manipnet.telemetry import Telemetry

MAX_REQUEST_BYTES: Final = 65_536
"""A hand profile as JSON with all its digits has 10 000."""
REQUESTS_PER_S: Final = 200
BURST: Final = 50
"""Totals over all clients; above them, replies are delayed to protect tick time."""
MOST_ANSWERS: Final = 4
"""Answers that wait for a client that does not read; one with a mesh may have 10 MB."""
_ANSWERS: Final = "inproc://answers"


class Control:
    """Lets clients submit requests to `dispatcher` on `tcp://host:port`."""

    def __init__(
        self, host: str, port: int, dispatcher: Dispatcher, telemetry: Telemetry, keys: ServerKeys | None = None
    ) -> None:
        """Bind the socket; `start` begins to answer. With `keys`, only clients on their list may ask.

        Raises `ListenError`.
        """
        self._dispatcher, self._throttle = dispatcher, Throttle(REQUESTS_PER_S, BURST)
        self._host, self._telemetry, self._keys = host, telemetry, keys
        try:
            self._door = self._open(port)
        except ListenError as error:
            raise ListenError(f"--control-port: {error}") from None
        self.address = self._door.bound.address
        self._health = ReceiverHealth("control", telemetry)
        self._thread = SupervisedThread("control", self._health, self._run, self._reopen)

    def start(self) -> None:
        """Begin to answer."""
        self._thread.start()

    def stop(self) -> None:
        """Stop answering and free the port."""
        self._thread.stopping.set()
        self._door.stop_replies()
        if self._thread.is_alive():
            self._door.bound.interrupt()
            self._thread.join()
        self._door.close()

    def connected(self) -> int:
        """The number of connected clients. From any thread."""
        return self._door.bound.connected()

    def _open(self, port: int) -> "_Door":
        limits = MAX_REQUEST_BYTES, MOST_ANSWERS
        return _Door(BoundSocket(zmq.ROUTER, self._host, port, self._telemetry, self._keys, *limits))

    def _reopen(self) -> None:
        self._door.close()
        self._door = self._open(int(self.address.rpartition(":")[2]))

    def _run(self) -> None:
        """Answer until the context is terminated, which raises `zmq.ContextTerminated`."""
        door, poller = self._door, zmq.Poller()
        with door.bound.socket as router, door.answers as answers:
            poller.register(router, zmq.POLLIN)
            poller.register(answers, zmq.POLLIN)
            while True:
                for ready, _ in poller.poll():
                    if ready is answers:
                        answer = answers.recv_multipart()
                        self._guarded(router.send_multipart, answer)
                    else:
                        request = router.recv_multipart(copy=False)
                        self._guarded(self._receive, door, request)

    def _guarded(self, action: Callable[..., object], *arguments: object) -> None:
        """Handle one message; an error costs this message only."""
        try:
            action(*arguments)
        except zmq.ContextTerminated:
            raise
        except Exception:
            self._health.message_failed()

    def _receive(self, door: "_Door", frames: list[zmq.Frame]) -> None:
        """One message: the client's identity, an empty frame, and the request."""
        door.bound.delivered(frames[0])
        time.sleep(self._throttle.delay_s(time.monotonic()))
        identity, *rest = frames
        if not rest or rest[0].bytes:  # not from a REQ socket, which alone could read an answer
            return
        envelope = [identity.bytes, b""]
        here = is_loopback(str(identity.get("Peer-Address")))
        self._dispatcher.submit(
            [frame.bytes for frame in rest[1:]], lambda answer: door.reply([*envelope, answer]), here
        )


class _Door:
    """The bound socket, and the internal sockets through which other threads send answers, in the same context."""

    def __init__(self, bound: BoundSocket) -> None:
        self.bound = bound
        self.answers: zmq.Socket = bound.context.socket(zmq.PULL)
        self.answers.setsockopt(zmq.LINGER, 0)
        self.answers.bind(_ANSWERS)
        self._replies: zmq.Socket = bound.context.socket(zmq.PUSH)
        self._replies.setsockopt(zmq.LINGER, 0)
        self._replies.connect(_ANSWERS)
        self._replying = threading.Lock()

    def reply(self, message: list[bytes]) -> None:
        """Let the thread of the bound socket send an answer. From any thread; does nothing after `stop_replies`."""
        with self._replying:
            if not self._replies.closed:
                self._replies.send_multipart(message)

    def stop_replies(self) -> None:
        """Close what `reply` uses, so that the context can end. From any thread."""
        with self._replying:
            self._replies.close()

    def close(self) -> None:
        """Close everything. Belongs to the thread that uses the bound socket, or comes after its end."""
        self.stop_replies()
        self.answers.close()
        self.bound.close()
