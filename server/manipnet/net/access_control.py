"""Access control of a bound ZeroMQ socket: who may connect, how many at once, and what is logged about the others."""

import logging
import threading
import time
from collections.abc import Callable
from typing import Any, Final

import zmq
from zmq.utils.monitor import parse_monitor_message

from manipnet.common.log_limits import LogThrottle
from manipnet.net.connection_limits import Connections
from manipnet.net.curve_keys import ServerKeys
from manipnet.net.zap import DOMAIN, ZAP_ADDRESS, ClientList, open_door, secure_server
from manipnet.telemetry import Telemetry

MOST_CONNECTIONS: Final = 64
HANDSHAKE_MS: Final = 5_000
"""A connection that has not completed its handshake is closed after this time."""
LOOK_MS: Final = 200
SOON_MS: Final = 20
"""When to look again after a handshake has succeeded."""
_LOG_PERIOD_S: Final = 5.0
_REFUSED: Final = {
    "handshake": "a client that does not speak ZMTP 3{keys}, or whose socket is not a {peer} socket",
    "socket_type": "a client whose socket has the wrong type (a PUSH, say): use a {peer} socket that connects here",
    "not_listed": "a client whose key is not in clients.allow",
    "too_many": "a client, since too many are connected or in the handshake",
    "endless": "a client that sends frames without end, but no message",
}
_PEERS: Final[dict[Any, str]] = {zmq.SUB: "PUB", zmq.PUB: "SUB", zmq.XPUB: "SUB", zmq.REP: "REQ", zmq.ROUTER: "REQ"}
"""The type of socket that may connect to a socket."""
_EVENTS: Final = zmq.Event.LISTENING | zmq.Event.ACCEPTED | zmq.Event.HANDSHAKE_SUCCEEDED | zmq.Event.DISCONNECTED
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
        failed: Callable[[], object] = lambda: None,
    ) -> None:
        """Call this before `socket` is bound. Raises `KeyFileError` for a list that cannot be read.

        `failed` is called on the thread when it cannot go on.
        """
        self._telemetry, self._failed = telemetry, failed
        self._answer = open_door if keys is None else ClientList(keys).answer
        self.connections = Connections(most, self._refuse, curve=keys is not None)
        self._peer = _PEERS.get(socket.getsockopt(zmq.TYPE), "matching")
        self._keys = "" if keys is None else ", that has the wrong keys"
        self._log_throttle = LogThrottle(_LOG_PERIOD_S)
        if keys is not None:
            secure_server(socket, keys)
        socket.setsockopt(zmq.ZAP_DOMAIN, DOMAIN)
        socket.setsockopt(zmq.HANDSHAKE_IVL, HANDSHAKE_MS)
        self._zap: zmq.Socket = context.socket(zmq.REP)
        self._zap.setsockopt(zmq.LINGER, 0)
        self._zap.bind(ZAP_ADDRESS)
        self._monitor = socket.get_monitor_socket(_EVENTS)
        self._thread = threading.Thread(target=self._run, name="access", daemon=True)
        self._thread.start()

    def join(self) -> None:
        """Wait until its own sockets are closed. Call this once the context is being terminated."""
        self._thread.join()

    def _run(self) -> None:
        try:
            self._serve()
        except zmq.ContextTerminated:
            return
        except Exception:
            _log.exception("nobody can connect any more, so the socket is opened again")
        finally:
            self._monitor.close()
            self._zap.close()
        self._failed()

    def _serve(self) -> None:
        poller = zmq.Poller()
        poller.register(self._monitor, zmq.POLLIN)
        poller.register(self._zap, zmq.POLLIN)
        look_s = time.monotonic()
        while True:
            wait_ms = SOON_MS if self.connections.unsettled else LOOK_MS
            events = self._monitor in dict(poller.poll(wait_ms))
            for _ in range(MOST_CONNECTIONS):  # before the events, which tell how the handshake of a client went on
                if not self._zap.poll(0):
                    break
                self._zap.send_multipart(self._reply(self._zap.recv_multipart()))
            if events:
                self._guarded(self._note, self._monitor.recv_multipart())
            if time.monotonic() - look_s >= 1e-3 * wait_ms:
                look_s = time.monotonic()
                self._guarded(self.connections.look)

    def _guarded(self, action: Callable[..., object], *arguments: object) -> None:
        """Do something whose failure must not keep everybody out."""
        try:
            action(*arguments)
        except Exception:
            if self._log_throttle.admit("internal") is not None:
                _log.exception("connections could not be checked; the next check follows")

    def _note(self, parts: list[bytes]) -> None:
        message = parse_monitor_message(parts)
        match message["event"]:
            case zmq.Event.ACCEPTED:
                self.connections.opened(message["value"])
            case zmq.Event.HANDSHAKE_SUCCEEDED:
                self.connections.succeeded()
            case zmq.Event.DISCONNECTED:
                self.connections.closed(message["value"])
            case zmq.Event.LISTENING:
                self.connections.listening(int(message["endpoint"].rpartition(b":")[2]))

    def _reply(self, request: list[bytes]) -> list[bytes]:
        """What is answered to a request of RFC 27; it must be answered, or nobody could connect any more."""
        try:
            reply, is_listed = self._answer(request)
        except Exception:
            if self._log_throttle.admit("internal") is not None:
                _log.exception("a client was refused, since its key could not be checked")
            reply, is_listed = [*request[:2], b"500", b"internal", b"", b""], False
        if is_listed:
            self.connections.let_in()
        else:
            self.connections.denied()
            self._refuse("not_listed")
        return reply

    def _refuse(self, reason: str) -> None:
        self._telemetry.count("connections_refused", reason=reason)
        if self._log_throttle.admit(reason) is not None:
            _log.warning("refused (%s) %s", reason, _REFUSED[reason].format(peer=self._peer, keys=self._keys))
