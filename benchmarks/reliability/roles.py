"""Run a sender or clients of a server as a separate process, which other measurements stop and kill.

The role `perform` sends the bodies of a recording and reconnects whenever the server goes away. `look` is the Python
client; it prints a line for each connection, for each session, and whenever live hands begin or end. `crowd` is a
number of subscribers that read everything, and `slow` is one that reads once a second. Every line begins with the
monotonic time; the first is `loaded`, and `connected` follows.
"""

import argparse
import subprocess
import sys
import time

import zmq

from benchmarks.support import ROOT, Client
from benchmarks.traffic import zmq_sender
from manipnet.inputs.playback import PlayError, looped, play
from manipnet.recording.mcap_file import read_bodies
from manipnet.wire import TOPIC_MSGPACK

RETRY_S, FRESH_S = 0.05, 0.1


def start(role: str, address: str, *more: str) -> subprocess.Popen[str]:
    """Start a process with that role; it prints its lines to `stdout`."""
    command = [sys.executable, "-m", "benchmarks.reliability.roles", role, address, *more]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)


def say(*words: object) -> None:
    """Print one line that begins with the time."""
    print(f"{time.monotonic():.6f}", *words, flush=True)


def perform(address: str, path: str) -> None:
    """Send the frames of a recording in a loop."""
    recorded = list(read_bodies(path))
    say("loaded")
    while True:
        try:
            sender = zmq_sender(address)
        except PlayError:
            time.sleep(RETRY_S)
            continue
        say("connected")
        try:
            play(looped(recorded), sender)
        except PlayError:
            sender.close()


def look(address: str) -> None:
    """Receive with the Python client and print what changes."""
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
    """Read everything with `count` subscribers on one thread."""
    context, poller = zmq.Context(), zmq.Poller()
    for _ in range(int(count)):
        socket = _subscriber(context, address)
        poller.register(socket, zmq.POLLIN)
    say("connected")
    while True:
        for socket, _ in poller.poll():
            socket.recv(copy=False)


def slow(address: str) -> None:
    """Read one message a second."""
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("role", choices=ROLES)
    parser.add_argument("address", help="tcp://HOST:PORT")
    parser.add_argument("more", nargs="*", help="the recording to perform, or the number of subscribers in the crowd")
    arguments = parser.parse_args()
    ROLES[arguments.role](arguments.address, *arguments.more)


ROLES = {"perform": perform, "look": look, "crowd": crowd, "slow": slow}

if __name__ == "__main__":
    main()
