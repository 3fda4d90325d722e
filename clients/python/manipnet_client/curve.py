"""A subscription with ZeroMQ's CURVE encryption, for a server that other machines can reach. Needs pyzmq."""

from __future__ import annotations

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
SLICE_MS = 50
"""How soon a wait notices that it should end: a ZeroMQ socket cannot be closed from another thread."""

HIGH_WATER_MARK = 64
WHAT_WENT_WRONG = {
    zmq.Event.HANDSHAKE_FAILED_AUTH: "the server does not list this client's key (its clients.allow)",
    zmq.Event.HANDSHAKE_FAILED_PROTOCOL: "the server speaks no CURVE, or its key is not the one in this client's file",
    zmq.Event.HANDSHAKE_FAILED_NO_DETAIL: "the server turned this client away: is its key the one in this file?",
    zmq.Event.DISCONNECTED: "the server closed the connection",
    zmq.Event.CLOSED: "nobody answers",
}


def read_keys(path: str | PathLike[str]) -> dict[str, str]:
    """The keys in the file that `manipnet keys make NAME` made; raises `ValueError` with the remedy."""
    try:
        text = Path(path).read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"cannot read {path}: {error}; `manipnet keys make NAME` on the server makes it") from None
    found = dict(re.findall(r'^(\w+) = "([^"]{40})"$', text, re.MULTILINE))
    if missing := [key for key in KEYS if key not in found]:
        raise ValueError(f"{path} has no {missing[0]!r} of 40 characters; `manipnet keys make NAME` makes it anew")
    return {key: found[key] for key in KEYS}


class SecureSubscription:
    """As `zmtp.Subscription`, encrypted. Not thread-safe, but `interrupt` may come from anywhere."""

    def __init__(
        self, host: str, port: int, topic: bytes, max_bytes: int, keys: Mapping[str, str], timeout_s: float = 2.0
    ) -> None:
        self._interrupted = False
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.SUB)
        self._events = self._socket.get_monitor_socket(
            zmq.Event.HANDSHAKE_SUCCEEDED | sum(WHAT_WENT_WRONG, zmq.Event(0))
        )
        self._poller = zmq.Poller()
        self._poller.register(self._socket, zmq.POLLIN)
        self._poller.register(self._events, zmq.POLLIN)
        try:
            self._configure(max_bytes, keys)
            self._socket.connect(f"tcp://[{host}]:{port}" if ":" in host else f"tcp://{host}:{port}")
            self._handshake(timeout_s)
            self._socket.subscribe(topic)
        except zmq.ZMQError as error:
            self.close()
            raise ZmtpError(f"cannot connect to {host}:{port}: {error}") from None
        except BaseException:
            self.close()
            raise

    def interrupt(self) -> None:
        """End a waiting `batches` with `OSError`."""
        self._interrupted = True

    def close(self) -> None:
        """Close the connection."""
        self._socket.disable_monitor()
        self._events.close()
        self._socket.close(linger=0)
        self._context.term()

    def batches(self) -> Iterator[list[bytes]]:
        """All frames that have arrived by now, oldest first, again and again; empty lists while it is silent.

        Raises `OSError` when the connection is lost or the other side is silent even to a ping.
        """
        while True:
            yield self._messages()
            self._wait()

    def _configure(self, max_bytes: int, keys: Mapping[str, str]) -> None:
        numbers = {
            zmq.LINGER: 0,
            zmq.RCVHWM: HIGH_WATER_MARK,
            zmq.MAXMSGSIZE: max_bytes,
            zmq.IPV6: 1,
            zmq.RECONNECT_IVL: -1,  # the client reconnects, and says why it must
            zmq.HEARTBEAT_IVL: int(1000 * PING_AFTER_S),
            zmq.HEARTBEAT_TIMEOUT: int(1000 * DEAD_AFTER_S),
        }
        for option, number in numbers.items():
            self._socket.setsockopt(option, number)
        for option, key in zip((zmq.CURVE_PUBLICKEY, zmq.CURVE_SECRETKEY, zmq.CURVE_SERVERKEY), KEYS, strict=True):
            self._socket.setsockopt_string(option, keys[key])

    def _handshake(self, timeout_s: float) -> None:
        give_up = time.monotonic() + timeout_s
        while time.monotonic() < give_up:
            if self._wait():
                return
        raise ZmtpError("the other side does not speak ZMTP 3: it keeps silent")

    def _messages(self) -> list[bytes]:
        """What has arrived. Ours have one frame; longer ones are left out."""
        found = []
        while True:
            try:
                parts = self._socket.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return found
            if len(parts) == 1:
                found.append(parts[0])

    def _wait(self) -> bool:
        """Wait for news; whether the handshake has been made. Raises `ZmtpError` when the connection is lost."""
        ready = dict(self._poller.poll(SLICE_MS))
        if self._interrupted:
            raise ZmtpError("closed")
        if self._events not in ready:
            return False
        event = recv_monitor_message(self._events)["event"]
        if event in WHAT_WENT_WRONG:
            raise ZmtpError(WHAT_WENT_WRONG[event])
        return event == zmq.Event.HANDSHAKE_SUCCEEDED
