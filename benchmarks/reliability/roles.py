"""People around a server as processes of their own, which can be stopped and killed: `python -m … ROLE ADDRESS …`.

`perform` sends bodies, its time from zero, and goes on whatever becomes of the server. `look` is the Python client; it
prints a line for each connection, each session, and whenever live hands come or stop coming. `crowd` is N subscribers
that read everything, `slow` one that reads once a second. Every line begins with the monotonic time; `loaded` is the
first, `connected` follows.
"""

import subprocess
import sys
import time
from pathlib import Path

import zmq

from manipnet.inputs.playback import PlayError, looped, play
from manipnet.recording.mcap_file import read_bodies
from manipnet.wire import TOPIC_MSGPACK

from .live import zmq_sender

ROOT = Path(__file__).parents[2]
AGAIN_S, FRESH_S = 0.05, 0.1


def start(role: str, address: str, *more: str) -> subprocess.Popen[str]:
    """A process of that role; its lines come on `stdout`."""
    command = [sys.executable, "-m", "benchmarks.reliability.roles", role, address, *more]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)


def say(*words: object) -> None:
    """One line, with the time."""
    print(f"{time.monotonic():.6f}", *words, flush=True)


def perform(address: str, path: str) -> None:
    """The frames of a recording, for ever."""
    recorded = list(read_bodies(path))
    say("loaded")
    while True:
        try:
            sender = zmq_sender(address)
        except PlayError:
            time.sleep(AGAIN_S)
            continue
        say("connected")
        try:
            play(looped(recorded), sender)
        except PlayError:
            sender.close()


def look(address: str) -> None:
    """The Python client, for ever."""
    sys.path.insert(0, str(ROOT / "clients" / "python"))
    from manipnet_client import Client

    say("loaded")
    with Client(address) as client:
        newest, session, connections, live = None, None, 0, False
        while True:
            newest = client.wait(newest, 0.02) or newest
            if client.stats().connections != connections:
                connections, live = client.stats().connections, False
                say("connected", connections)
            if newest is None:
                continue
            if newest.session != session:
                session = newest.session
                say("session", session)
            hands = [hand for hand in (newest.left, newest.right) if hand is not None]
            is_live = client.stats().age_s < FRESH_S and all(hand.state == "live" for hand in hands)
            if is_live != live:
                live = is_live
                say("live" if live else "lost", session)


def crowd(address: str, count: str) -> None:
    """Many subscribers, on one thread."""
    context, poller = zmq.Context(), zmq.Poller()
    for _ in range(int(count)):
        socket = _subscriber(context, address)
        poller.register(socket, zmq.POLLIN)
    say("connected")
    while True:
        for socket, _ in poller.poll():
            socket.recv(copy=False)


def slow(address: str) -> None:
    """A subscriber that reads once a second."""
    socket = _subscriber(zmq.Context(), address)
    say("connected")
    while True:
        socket.recv()
        time.sleep(1.0)


def _subscriber(context: zmq.Context, address: str) -> zmq.Socket:
    socket = context.socket(zmq.SUB)
    socket.subscribe(TOPIC_MSGPACK)
    socket.connect(address)
    socket.recv()
    return socket


if __name__ == "__main__":
    {"perform": perform, "look": look, "crowd": crowd, "slow": slow}[sys.argv[1]](*sys.argv[2:])
