"""Connections with ZeroMQ's CURVE encryption, for a server that other machines can reach. They need pyzmq."""

from __future__ import annotations

import contextlib
import re
import time
from collections.abc import Iterator, Mapping
from os import PathLike
from pathlib import Path

from .zmtp import DEAD_AFTER_S, PING_AFTER_S, ZmtpError

try:
    import zmq
    from zmq.utils.monitor import recv_monitor_message
except ImportError as error:
    raise ImportError('connecting with keys needs pyzmq: pip install "manipnet-client[curve]"') from error

KEYS = ("public", "secret", "server_public")
HANDSHAKE_S = 2.0
SLICE_MS = 50
"""How often a wait checks whether it should end, because no other thread may close a ZeroMQ socket."""

HIGH_WATER_MARK = 64
FAILURES: Mapping[int, str] = {
    zmq.Event.HANDSHAKE_FAILED_AUTH: "the server does not list this client's key (in its clients.allow)",
    zmq.Event.HANDSHAKE_FAILED_PROTOCOL: "the server does not use CURVE, or its key is not the one in this file",
    zmq.Event.HANDSHAKE_FAILED_NO_DETAIL: "the server refused this client; check that its key is the one in this file",
    zmq.Event.DISCONNECTED: "the server closed the connection",
    zmq.Event.CLOSED: "no server answers",
}
"""The reason of each event that ends a connection."""


def read_keys(path: str | PathLike[str]) -> dict[str, str]:
    """The keys in the file that `manipnet keys make NAME` wrote; raises `ValueError`, whose text names the remedy."""
    try:
        text = Path(path).read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"cannot read {path}: {error}; `manipnet keys make NAME` on the server writes it") from None
    found = dict(re.findall(r'^(\w+) = "([^"]{40})"$', text, re.MULTILINE))
    if missing := [key for key in KEYS if key not in found]:
        raise ValueError(
            f"{path} has no {missing[0]!r} of 40 characters; `manipnet keys make NAME` on the server writes a new file"
        )
    return {key: found[key] for key in KEYS}


class SecureConnection:
    """An encrypted connection after its handshake. Not thread-safe, but any thread may call `interrupt`."""

    def __init__(
        self,
        host: str,
        port: int,
        socket_type: int,
        max_bytes: int,
        keys: Mapping[str, str],
        timeout_s: float = HANDSHAKE_S,
    ) -> None:
        """Connect as a `socket_type` (`zmq.SUB` or `zmq.REQ`); raises `OSError`."""
        self._interrupted = False
        self._context = zmq.Context()
        self._socket = self._context.socket(socket_type)
        self._events = self._socket.get_monitor_socket(zmq.Event.HANDSHAKE_SUCCEEDED | sum(FAILURES))
        self._poller = zmq.Poller()
        self._poller.register(self._socket, zmq.POLLIN)
        self._poller.register(self._events, zmq.POLLIN)
        try:
            self._configure(max_bytes, keys)
            self._socket.connect(f"tcp://[{host}]:{port}" if ":" in host else f"tcp://{host}:{port}")
            self._handshake(timeout_s)
        except zmq.ZMQError as error:
            self.close()
            raise ZmtpError(f"cannot connect to {host}:{port}: {error}") from None
        except BaseException:
            self.close()
            raise

    def interrupt(self) -> None:
        """Make a `wait` raise `OSError`."""
        self._interrupted = True

    def close(self) -> None:
        """Close the connection."""
        self._socket.disable_monitor()
        self._events.close()
        self._socket.close(linger=0)
        self._context.term()

    def send(self, body: bytes) -> None:
        """Send one message."""
        self._socket.send(body)

    def subscribe(self, topic: bytes) -> None:
        """Ask for the messages that begin with `topic`."""
        self._socket.subscribe(topic)

    def receive(self) -> list[bytes] | None:
        """The frames of the next message, or None when none has arrived."""
        try:
            return self._socket.recv_multipart(zmq.NOBLOCK)
        except zmq.Again:
            return None

    def wait(self) -> bool:
        """Wait shortly for a message or an event and return whether the handshake has just succeeded.

        Raises `ZmtpError` when the connection is lost.
        """
        ready = dict(self._poller.poll(SLICE_MS))
        if self._interrupted:
            raise ZmtpError("closed")
        if self._events not in ready:
            return False
        event = recv_monitor_message(self._events)["event"]
        if event in FAILURES:
            raise ZmtpError(FAILURES[event])
        return event == zmq.Event.HANDSHAKE_SUCCEEDED

    def _configure(self, max_bytes: int, keys: Mapping[str, str]) -> None:
        numbers = {
            zmq.LINGER: 0,
            zmq.RCVHWM: HIGH_WATER_MARK,
            zmq.MAXMSGSIZE: max_bytes,
            zmq.IPV6: 1,
            zmq.RECONNECT_IVL: -1,  # the caller reconnects, because only then can it report the reason
            zmq.HEARTBEAT_IVL: int(1000 * PING_AFTER_S),
            zmq.HEARTBEAT_TIMEOUT: int(1000 * DEAD_AFTER_S),
        }
        for option, number in numbers.items():
            self._socket.setsockopt(option, number)
        for option, key in zip((zmq.CURVE_PUBLICKEY, zmq.CURVE_SECRETKEY, zmq.CURVE_SERVERKEY), KEYS, strict=True):
            self._socket.setsockopt_string(option, keys[key])

    def _handshake(self, timeout_s: float) -> None:
        give_up_s = time.monotonic() + timeout_s
        while time.monotonic() < give_up_s:
            if self.wait():
                return
        raise ZmtpError("the other side does not speak ZMTP 3: it sends nothing")


class SecureSubscription(SecureConnection):
    """`zmtp.Subscription`, encrypted."""

    def __init__(self, host: str, port: int, topic: bytes, max_bytes: int, keys: Mapping[str, str]) -> None:
        """Connect and subscribe; raises `OSError`."""
        super().__init__(host, port, zmq.SUB, max_bytes, keys)
        self.subscribe(topic)

    def batches(self) -> Iterator[list[bytes]]:
        """Yield all messages received so far, oldest first, again and again; an empty list while none arrive.

        Raises `OSError` when the connection is lost or when the other side does not even answer a ping.
        """
        while True:
            yield self._messages()
            self.wait()

    def _messages(self) -> list[bytes]:
        """The messages of one frame, as all of ours are; longer messages are skipped."""
        found = []
        while (parts := self.receive()) is not None:
            if len(parts) == 1:
                found.append(parts[0])
        return found


def request(host: str, port: int, body: bytes, max_bytes: int, keys: Mapping[str, str], timeout_s: float) -> bytes:
    """`zmtp.request`, encrypted."""
    give_up_s = time.monotonic() + timeout_s
    with contextlib.closing(
        SecureConnection(host, port, zmq.REQ, max_bytes, keys, min(timeout_s, HANDSHAKE_S))
    ) as connection:
        connection.send(body)
        while time.monotonic() < give_up_s:
            connection.wait()
            if parts := connection.receive():
                return parts[-1]
    raise TimeoutError
