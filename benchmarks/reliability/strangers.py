"""Clients with the wrong keys at each ZeroMQ socket of a server with keys, while a listed pair performs.

Six kinds: a listed key but another server's public key; no key; ZeroMQ's user name and password instead (PLAIN); a good
key that is on no list; and TCP clients that speak no ZeroMQ, one that is silent and one that speaks HTTP. Each watches
hands, sends bodies and asks; nothing may reach it or be taken of it, each refusal must be counted, and the listed pair
must miss no message.
"""

import socket
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import msgpack
import zmq
from live_server import LiveServer, serving

from manipnet.net.curve_keys import ClientKeys, make_client_keys, make_server_keys, read_client_keys
from manipnet.net.zap import secure_client
from manipnet.wire import TOPIC_MSGPACK, decode_msgpack
from manipnet.wire.bodies import BodyFrame, bodies_map

from .motion import frames, motion
from .row import Row, parser, report

RATE_HZ = 120.0
TCP = {"silent TCP": b"", "HTTP": b"GET / HTTP/1.1\r\n\r\n"}
STRANGERS = ("wrong server key", "no key", "PLAIN", "key not on the list", *TCP)


def stranger_keys(kind: str, folder: Path, listed: ClientKeys) -> ClientKeys | None:
    """The keys of a stranger, from another server's `folder`; none for one without."""
    if kind not in ("wrong server key", "key not on the list"):
        return None
    other = make_server_keys(folder)
    if kind == "wrong server key":
        return replace(listed, server_public=other.pair.public)
    return replace(listed, pair=read_client_keys(make_client_keys(folder, "stranger")).pair)


class Stranger:
    """One stranger at three sockets; what it received."""

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
        """Send a frame, see whether anything came."""
        self._bodies.send(msgpack.packb(bodies_map(frame)) or b"")
        for sock in (self._hands, self._control):
            self.received += bool(sock.poll(0) and sock.recv())

    def close(self) -> None:
        self._context.destroy(linger=0)


class TcpStranger:
    """Opens TCP connections and says something; counts bytes beyond ZeroMQ's own greeting of 64."""

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
        """Send some, read some."""
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
    """A stranger beside a listed pair."""
    performance = motion(RATE_HZ)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_server_keys(folder)
        listed = read_client_keys(make_client_keys(folder, "listed"))
        keys = stranger_keys(kind, folder / "other", listed)
        meshes = [f"--mesh={prop}={path}" for prop, path in performance.meshes.items()]
        with serving(*meshes, "--keys", str(folder)) as server, zmq.Context() as context:
            before = server.ask({"op": "status"}, keys=listed)["counters"]
            messages, frames_sent, received = _perform(server, context, listed, kind, keys, performance, seconds)
            counters = server.ask({"op": "status"}, keys=listed)["counters"]
    refused = {
        reason: count - before.get("connections_refused", {}).get(reason, 0)
        for reason, count in counters.get("connections_refused", {}).items()
    }
    taken = counters["frames_in"]["zmq"] - frames_sent
    missing = messages[-1].seq - messages[0].seq + 1 - len(messages)
    print(kind, refused, received, taken, missing, file=sys.stderr, flush=True)
    return Row(
        f"{kind}, {seconds:g} s at hands, bodies and control",
        "zero frames, counted, server unharmed",
        f"{received} messages to it, {taken} frames taken of it, refused {refused or 'none counted'}; the listed "
        f"client had {len(messages)} messages, {missing} missing",
        received == 0 and taken == 0 and missing == 0 and sum(refused.values()) >= 3,
        {"refused": refused, "received": received, "taken": taken, "messages": len(messages), "missing": missing},
    )


def _perform(server, context, listed, kind, keys, performance, seconds):
    """The listed pair performs, the stranger tries: hands messages of the listed, frames sent, the stranger's catch."""
    hands, bodies = context.socket(zmq.SUB), context.socket(zmq.XPUB)
    for sock, where in ((hands, "hands"), (bodies, "bodies")):
        sock.setsockopt(zmq.LINGER, 0)
        sock.setsockopt(zmq.RCVHWM, 0)
        secure_client(sock, listed)
        sock.connect(server.addresses[where])
    hands.subscribe(TOPIC_MSGPACK)
    if not bodies.poll(10_000):
        raise TimeoutError("the listed sender was not let in")
    stranger = TcpStranger(server, TCP[kind]) if kind in TCP else Stranger(server, keys, kind == "PLAIN")
    messages, sent, begin_s = [], 0, time.monotonic()
    for frame in frames(performance, seconds):
        time.sleep(max(begin_s + frame.t_s - time.monotonic(), 0.0))
        bodies.send(msgpack.packb(bodies_map(frame)) or b"")
        sent += 1
        stranger.act(replace(frame, t_s=frame.t_s + 1e4))
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
