"""Clients without valid keys at each ZeroMQ socket of a server with keys, beside a listed sender and subscriber.

There are six kinds: a listed key with another server's public key; no key; ZeroMQ's user name and password (PLAIN); a
valid key that is not on the list; and two TCP clients that do not speak ZeroMQ, one silent and one speaking HTTP. Each
subscribes to hands, sends bodies and sends requests. The server must send it nothing, accept nothing from it and count
each refusal, and the listed subscriber must receive every message.
"""

import socket
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import msgpack
import zmq

from benchmarks.support import LiveServer, serving
from manipnet.net.curve_keys import ClientKeys, make_client_keys, make_server_keys, read_client_keys
from manipnet.net.zap import secure_client
from manipnet.wire import TOPIC_MSGPACK, HandsMessage, decode_msgpack
from manipnet.wire.bodies import BodyFrame, bodies_map

from .motion import frames, mesh_options, motion
from .row import Row, parser, report

RATE_HZ = 120.0
TCP = {"silent TCP": b"", "HTTP": b"GET / HTTP/1.1\r\n\r\n"}
STRANGERS = ("wrong server key", "no key", "PLAIN", "key not on the list", *TCP)


def stranger_keys(kind: str, folder: Path, listed: ClientKeys) -> ClientKeys | None:
    """The keys of a stranger, made in another server's `folder`; None for a stranger without keys."""
    if kind not in ("wrong server key", "key not on the list"):
        return None
    other = make_server_keys(folder)
    if kind == "wrong server key":
        return replace(listed, server_public=other.pair.public)
    return replace(listed, pair=read_client_keys(make_client_keys(folder, "stranger")).pair)


class Stranger:
    """A ZeroMQ client at three sockets, which counts what it receives."""

    def __init__(self, server: LiveServer, keys: ClientKeys | None, plain: bool) -> None:
        self.received = 0
        self._context = zmq.Context()
        self._hands, self._bodies, self._control = (self._context.socket(kind) for kind in (zmq.SUB, zmq.PUB, zmq.REQ))
        for name, sock in (("hands", self._hands), ("bodies", self._bodies), ("control", self._control)):
            sock.setsockopt(zmq.LINGER, 0)
            if keys is not None:
                secure_client(sock, keys)
            if plain:
                sock.plain_username, sock.plain_password = b"stage", b"stage"
            sock.connect(server.addresses[name])
        self._hands.subscribe(b"")
        self._control.send(msgpack.packb({"op": "status"}) or b"")

    def act(self, frame: BodyFrame) -> None:
        """Send a frame and count what has arrived."""
        self._bodies.send(msgpack.packb(bodies_map(frame)) or b"")
        for sock in (self._hands, self._control):
            self.received += bool(sock.poll(0) and sock.recv())

    def close(self) -> None:
        self._context.destroy(linger=0)


class TcpStranger:
    """Opens TCP connections, sends `words` and counts the bytes that arrive after ZeroMQ's greeting of 64 bytes."""

    def __init__(self, server: LiveServer, words: bytes) -> None:
        self.received, self._words = 0, words
        self._sockets = [
            socket.create_connection(("127.0.0.1", int(server.addresses[name].rpartition(":")[2])))
            for name in ("hands", "bodies", "control")
        ]
        self._bytes = [0] * len(self._sockets)
        for sock in self._sockets:
            sock.setblocking(False)

    def act(self, frame: BodyFrame) -> None:
        """Send and read once at each connection."""
        for i, sock in enumerate(self._sockets):
            try:
                sock.send(self._words)
                self._bytes[i] += len(sock.recv(65_536))
            except (BlockingIOError, ConnectionError):
                pass
        self.received = sum(max(count - 64, 0) for count in self._bytes)

    def close(self) -> None:
        for sock in self._sockets:
            sock.close()


def visit(kind: str, seconds: float) -> Row:
    """Measure one kind of stranger beside a listed sender and subscriber."""
    scenario = motion(RATE_HZ)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_server_keys(folder)
        listed = read_client_keys(make_client_keys(folder, "listed"))
        keys = stranger_keys(kind, folder / "other", listed)
        with serving(*mesh_options(scenario), "--keys", str(folder)) as server, zmq.Context() as context:
            before = server.ask({"op": "status"}, keys=listed)["counters"]
            messages, frames_sent, received = _play(server, context, listed, kind, keys, frames(scenario, seconds))
            counters = server.ask({"op": "status"}, keys=listed)["counters"]
    refused = {
        reason: count - before.get("connections_refused", {}).get(reason, 0)
        for reason, count in counters.get("connections_refused", {}).items()
    }
    accepted = counters["frames_in"]["zmq"] - frames_sent
    missing = messages[-1].seq - messages[0].seq + 1 - len(messages)
    print(kind, refused, received, accepted, missing, file=sys.stderr, flush=True)
    return Row(
        f"{kind}, {seconds:g} s at hands, bodies and control",
        "nothing sent or accepted, refusals counted, listed clients unaffected",
        f"{received} messages sent to it, {accepted} frames accepted from it, refusals {refused or 'not counted'}; the "
        f"listed client received {len(messages)} messages, {missing} missing",
        received == 0 and accepted == 0 and missing == 0 and sum(refused.values()) >= 3,
        {"refused": refused, "received": received, "accepted": accepted, "messages": len(messages), "missing": missing},
    )


def _play(
    server: LiveServer,
    context: zmq.Context,
    listed: ClientKeys,
    kind: str,
    keys: ClientKeys | None,
    motion: Iterator[BodyFrame],
) -> tuple[list[HandsMessage], int, int]:
    """Play the motion with the listed keys while the stranger tries.

    Returns the listed subscriber's messages, the number of frames sent, and how much the stranger received.
    """
    hands, bodies = context.socket(zmq.SUB), context.socket(zmq.XPUB)
    for sock, where in ((hands, "hands"), (bodies, "bodies")):
        sock.setsockopt(zmq.LINGER, 0)
        sock.setsockopt(zmq.RCVHWM, 0)
        secure_client(sock, listed)
        sock.connect(server.addresses[where])
    hands.subscribe(TOPIC_MSGPACK)
    if not bodies.poll(10_000):
        raise TimeoutError("the server did not admit the listed sender")
    stranger = TcpStranger(server, TCP[kind]) if kind in TCP else Stranger(server, keys, kind == "PLAIN")
    messages, sent, begin_s = [], 0, time.monotonic()
    for frame in motion:
        time.sleep(max(begin_s + frame.t_s - time.monotonic(), 0.0))
        bodies.send(msgpack.packb(bodies_map(frame)) or b"")
        sent += 1
        stranger.act(frame._replace(t_s=frame.t_s + 1e4))
        while hands.poll(0):
            messages.append(decode_msgpack(hands.recv()[len(TOPIC_MSGPACK) :]))
    time.sleep(0.5)
    stranger.close()
    for sock in (hands, bodies):
        sock.close()
    return messages, sent, stranger.received


def main() -> None:
    arguments = parser(__doc__, 8.0).parse_args()
    report("strangers", [visit(kind, arguments.seconds) for kind in STRANGERS], arguments.out)


if __name__ == "__main__":
    main()
