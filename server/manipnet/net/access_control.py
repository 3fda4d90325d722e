"""Access control of a bound ZeroMQ socket: who may connect, how many at once, and what is logged about the others."""

import logging
import threading
import time
from typing import Final

import zmq
from zmq.utils.monitor import parse_monitor_message

from manipnet.net.connection_limits import Connections
from manipnet.net.curve_keys import ServerKeys
from manipnet.net.zap import ZAP_ADDRESS, ClientList, secure_server
from manipnet.telemetry import LogThrottle, Telemetry

MOST_CONNECTIONS: Final = 64
HANDSHAKE_MS: Final = 5_000
"""A connection that has not completed its handshake is closed after this time."""
LOOK_MS: Final = 200
_LOG_PERIOD_S: Final = 5.0
_REFUSED: Final = {
    "handshake": "a client that has the wrong keys, or that does not speak ZeroMQ",
    "not_listed": "a client whose key is not in clients.allow",
    "too_many": f"a client, since {MOST_CONNECTIONS} are connected already",
    "endless": "a client that sends frames without end, but no message",
}
_FAILURES: Final = zmq.Event.HANDSHAKE_FAILED_PROTOCOL | zmq.Event.HANDSHAKE_FAILED_NO_DETAIL
_EVENTS: Final = (
    zmq.Event.LISTENING | zmq.Event.ACCEPTED | zmq.Event.HANDSHAKE_SUCCEEDED | zmq.Event.DISCONNECTED | _FAILURES
)
_log = logging.getLogger(__name__)


class AccessControl:
    """Controls the access to one socket, on a thread of its own, until the socket's context is terminated.

    With `keys`, connections are encrypted, and only clients on the list may connect. The list may change at any time.
    """

    def __init__(
        self,
        context: zmq.Context,
        socket: zmq.Socket,
        telemetry: Telemetry,
        keys: ServerKeys | None = None,
        most: int = MOST_CONNECTIONS,
    ) -> None:
        """Call this before `socket` is bound. Raises `KeyFileError` for a list that cannot be read."""
        self._telemetry = telemetry
        self._clients = None if keys is None else ClientList(keys)
        self.connections = Connections(most, self._refuse)
        self._log_throttle = LogThrottle(_LOG_PERIOD_S)
        self._shaking, self._accepted_s = 0, float("-inf")
        """The connections whose handshake has neither succeeded nor failed, and when the newest one was accepted."""
        self._zap: zmq.Socket | None = None
        if keys is not None:
            secure_server(socket, keys)
            zap = self._zap = context.socket(zmq.REP)
            zap.setsockopt(zmq.LINGER, 0)
            zap.bind(ZAP_ADDRESS)
        socket.setsockopt(zmq.HANDSHAKE_IVL, HANDSHAKE_MS)
        self._monitor = socket.get_monitor_socket(_EVENTS)
        self._thread = threading.Thread(target=self._run, name="access", daemon=True)
        self._thread.start()

    def join(self) -> None:
        """Wait until its own sockets are closed. Call this once the context is being terminated."""
        self._thread.join()

    def _run(self) -> None:
        poller = zmq.Poller()
        sockets = [self._monitor] if self._zap is None else [self._monitor, self._zap]
        for socket in sockets:
            poller.register(socket, zmq.POLLIN)
        look_s = time.monotonic()
        try:
            while True:
                for socket, _ in poller.poll(LOOK_MS):
                    if socket is self._monitor:
                        self._note(socket.recv_multipart())
                    elif self._clients is not None:
                        self._answer(socket, self._clients)
                if time.monotonic() - look_s >= 1e-3 * LOOK_MS:
                    look_s = time.monotonic()
                    self.connections.look()
                    self._count_silent_failures(look_s)
        except zmq.ContextTerminated:
            pass
        finally:
            for socket in sockets:
                socket.close()

    def _note(self, parts: list[bytes]) -> None:
        message = parse_monitor_message(parts)
        match message["event"]:
            case zmq.Event.ACCEPTED:
                self._shaking += self.connections.opened(message["value"])
                self._accepted_s = time.monotonic()
            case zmq.Event.HANDSHAKE_SUCCEEDED:
                self._shaking -= 1
            case zmq.Event.DISCONNECTED:
                self.connections.closed(message["value"])
            case zmq.Event.LISTENING:
                self.connections.listening(int(message["endpoint"].rpartition(b":")[2]))
            case _:  # the client has no key, the wrong server key or no CURVE
                self._shaking -= 1
                self._refuse("handshake")

    def _count_silent_failures(self, now_s: float) -> None:
        """Count clients that do not speak ZeroMQ: they cause no event, but the event of success is missing."""
        if self._shaking and now_s - self._accepted_s > 2e-3 * HANDSHAKE_MS:
            for _ in range(self._shaking):
                self._refuse("handshake")
            self._shaking = 0

    def _answer(self, zap: zmq.Socket, clients: ClientList) -> None:
        reply, listed = clients.answer(zap.recv_multipart())
        zap.send_multipart(reply)
        if not listed:
            self._shaking -= 1
            self._refuse("not_listed")

    def _refuse(self, reason: str) -> None:
        self._telemetry.count("connections_refused", reason=reason)
        if self._log_throttle.admit(reason) is not None:
            _log.warning("refused (%s) %s", reason, _REFUSED[reason])
