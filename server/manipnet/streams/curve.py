"""Who may connect over ZeroMQ: CURVE encryption, and an allow-list that is asked at every handshake (ZAP).

CURVE alone lets anybody in who knows the server's public key; the list does not. Encryption, list and counting work
for every socket of one context: bodies in, hands out, control.
"""

import logging
import threading
import time

import zmq
from zmq.utils import z85

from manipnet.streams.keys import ClientKeys, KeyFileError, ServerKeys, read_allow_list
from manipnet.telemetry import Counters

_ZAP_ADDRESS = "inproc://zeromq.zap.01"  # fixed by ZeroMQ's RFC 27
_DOMAIN = b"manipnet"
_LOG_PERIOD_S = 5.0
_log = logging.getLogger(__name__)


class Gatekeeper:
    """Answers the handshakes of one context from `keys`' list, which may be edited at any time."""

    def __init__(self, context: zmq.Context, keys: ServerKeys, counters: Counters) -> None:
        """Take the context's one ZAP address; raises `KeyFileError` for a list that cannot be read."""
        read_allow_list(keys.allow_file)
        self._keys, self._counters = keys, counters
        self._listed: dict[str, str] = {}
        self._stamp: tuple[int, int] | None = None
        self._logged_s = float("-inf")
        self._monitors: list[zmq.Socket] = []
        self._zap = context.socket(zmq.REP)
        self._zap.setsockopt(zmq.LINGER, 0)
        self._zap.bind(_ZAP_ADDRESS)
        self._thread = threading.Thread(target=self._run, name="zap", daemon=True)

    def secure(self, socket: zmq.Socket) -> None:
        """Let only listed clients connect to `socket`. Call before it is bound, and before `start`."""
        socket.setsockopt(zmq.CURVE_SERVER, 1)
        socket.setsockopt_string(zmq.CURVE_PUBLICKEY, self._keys.pair.public)
        socket.setsockopt_string(zmq.CURVE_SECRETKEY, self._keys.pair.secret)
        socket.setsockopt(zmq.ZAP_DOMAIN, _DOMAIN)
        failures = zmq.Event.HANDSHAKE_FAILED_PROTOCOL | zmq.Event.HANDSHAKE_FAILED_NO_DETAIL
        self._monitors.append(socket.get_monitor_socket(failures))

    def start(self) -> None:
        """Answer from now on, until the context is terminated."""
        self._thread.start()

    def join(self) -> None:
        """Wait until the sockets are closed, after the context was told to terminate."""
        self._thread.join()

    def _run(self) -> None:
        poller = zmq.Poller()
        for socket in (self._zap, *self._monitors):
            poller.register(socket, zmq.POLLIN)
        try:
            while True:
                for socket, _ in poller.poll():
                    parts = socket.recv_multipart()
                    if socket is self._zap:
                        socket.send_multipart(self._answer(parts))
                    else:  # no key, a wrong server key, or no CURVE at all: it never came to the list
                        self._refuse("handshake", "a client without the right keys")
        except zmq.ContextTerminated:
            pass
        finally:
            for socket in (self._zap, *self._monitors):
                socket.close()

    def _answer(self, request: list[bytes]) -> list[bytes]:
        """The reply of RFC 27: `[version, request id, status, text, user id, metadata]`."""
        version, request_id, domain, address, _, mechanism, *credentials = request
        name = None
        if domain == _DOMAIN and mechanism == b"CURVE" and len(credentials) == 1:
            name = self._names().get(z85.encode(credentials[0]).decode("ascii"))
        if name is None:
            self._refuse("not_listed", f"a client at {address.decode(errors='replace')} whose key is on no list")
            return [version, request_id, b"400", b"not on the list", b"", b""]
        return [version, request_id, b"200", b"OK", name.encode("ascii"), b""]

    def _names(self) -> dict[str, str]:
        """The list as it is now; an unreadable one lets nobody in."""
        try:
            status = self._keys.allow_file.stat()
            stamp = (status.st_mtime_ns, status.st_size)
            if stamp != self._stamp:
                self._listed, self._stamp = read_allow_list(self._keys.allow_file), stamp
        except (OSError, KeyFileError) as error:
            self._listed, self._stamp = {}, None
            _log.error("nobody can connect: %s", error)
        return self._listed

    def _refuse(self, reason: str, who: str) -> None:
        self._counters.add("connections_refused", reason=reason)
        now_s = time.monotonic()
        if now_s - self._logged_s >= _LOG_PERIOD_S:
            self._logged_s = now_s
            _log.warning("kept out %s", who)


def secure_client(socket: zmq.Socket, keys: ClientKeys) -> None:
    """Give a client's socket its keys. Call before it connects."""
    socket.setsockopt_string(zmq.CURVE_PUBLICKEY, keys.pair.public)
    socket.setsockopt_string(zmq.CURVE_SECRETKEY, keys.pair.secret)
    socket.setsockopt_string(zmq.CURVE_SERVERKEY, keys.server_public)
