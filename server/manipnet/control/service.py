"""Requests from clients: a ROUTER socket, which REQ sockets connect to, on a thread of its own."""

import logging
import threading
import time
from typing import Final

import zmq

from manipnet.control.dispatcher import Dispatcher
from manipnet.net.addresses import is_loopback
from manipnet.net.curve_keys import ServerKeys
from manipnet.net.errors import ListenError
from manipnet.net.rate_limit import Throttle
from manipnet.net.zmq_socket import BoundSocket
from manipnet.telemetry import Telemetry

MAX_REQUEST_BYTES: Final = 4096
REQUESTS_PER_S: Final = 200
BURST: Final = 50
"""Totals over all clients; above them, replies are delayed to protect tick time."""
_ANSWERS: Final = "inproc://answers"
_log = logging.getLogger(__name__)


class Control:
    """Lets clients submit requests to `dispatcher` on `tcp://host:port`."""

    def __init__(
        self, host: str, port: int, dispatcher: Dispatcher, telemetry: Telemetry, keys: ServerKeys | None = None
    ) -> None:
        """Bind the socket; `start` begins to answer. With `keys`, only clients on their list may ask.

        Raises `ListenError`.
        """
        self._dispatcher, self._throttle = dispatcher, Throttle(REQUESTS_PER_S, BURST)
        try:
            self._bound = BoundSocket(zmq.ROUTER, host, port, telemetry, keys, MAX_REQUEST_BYTES)
        except ListenError as error:
            raise ListenError(f"--control-port: {error}") from None
        self.address = self._bound.address
        self._answers = self._bound.context.socket(zmq.PULL)
        self._answers.bind(_ANSWERS)
        self._to_answers = self._bound.context.socket(zmq.PUSH)
        self._to_answers.setsockopt(zmq.LINGER, 0)
        self._to_answers.connect(_ANSWERS)
        self._answering = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="control", daemon=True)

    def start(self) -> None:
        """Begin to answer."""
        self._thread.start()

    def stop(self) -> None:
        """Stop answering and free the port."""
        with self._answering:
            self._to_answers.close()
        if self._thread.is_alive():
            self._bound.interrupt()
            self._thread.join()
        else:
            self._answers.close()
            self._bound.close()

    def connected(self) -> int:
        """The number of connected clients. From any thread."""
        return self._bound.connected()

    def _run(self) -> None:
        poller = zmq.Poller()
        with self._bound.socket as router, self._answers as answers:
            poller.register(router, zmq.POLLIN)
            poller.register(answers, zmq.POLLIN)
            while True:
                try:
                    for ready, _ in poller.poll():
                        if ready is answers:
                            router.send_multipart(answers.recv_multipart())
                        else:
                            self._receive(router.recv_multipart(copy=False))
                except zmq.ContextTerminated:
                    return
                except zmq.ZMQError as error:
                    _log.warning("control: an answer was lost: %s", error)

    def _receive(self, frames: list[zmq.Frame]) -> None:
        """One message: the client's identity, an empty frame, and the request."""
        self._bound.delivered(frames[0])
        time.sleep(self._throttle.delay_s(time.monotonic()))
        identity, *rest = frames
        if not rest or rest[0].bytes:  # not from a REQ socket, which alone could read an answer
            return
        envelope = [identity.bytes, b""]

        def reply(answer: bytes) -> None:
            with self._answering:
                if not self._to_answers.closed:
                    self._to_answers.send_multipart([*envelope, answer])

        here = is_loopback(str(identity.get("Peer-Address")))
        self._dispatcher.submit([frame.bytes for frame in rest[1:]], reply, here)
