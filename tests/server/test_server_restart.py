"""A server that is killed and started again on its ports: sender and subscriber find it by themselves."""

import signal
import sys
import threading
import time
from pathlib import Path

import pytest
from live_server import LiveServer, Sender, Subscriber, scene, serving

from manipnet.synthesis.objects.library import LIBRARY_FOLDER

OPTIONS = {"hands": "port", "bodies": "input-port", "control": "control-port", "osc": "osc-port", "web": "web-port"}


def send_on(sender: Sender, stopping: threading.Event) -> None:
    begin_s = time.monotonic()
    while not stopping.wait(1.0 / 120.0):
        t_s = time.monotonic() - begin_s
        sender.send(t_s, scene(t_s))


def next_of_another(subscriber: Subscriber, session: str | None):
    message = subscriber.next()
    while message.session == session or any(hand.state != "live" for hand in message.hands.values()):
        message = subscriber.next()
    return message


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_a_killed_server_is_followed_by_another_on_the_same_ports(tiny_bundle: Path) -> None:
    options = ("--mesh", f"Box={LIBRARY_FOLDER / 'cube.ply'}", "--model", str(tiny_bundle))
    first = LiveServer(*options).wait_ready()
    ports = [f"--{option}={first.addresses[what].rpartition(':')[2]}" for what, option in OPTIONS.items()]
    sender, subscriber, stopping = (
        Sender(first.addresses["bodies"]),
        Subscriber(first.addresses["hands"]),
        threading.Event(),
    )
    thread = threading.Thread(target=send_on, args=(sender, stopping))
    thread.start()
    try:
        before = next_of_another(subscriber, None)
        first.stop(signal.SIGKILL)
        with serving(*options, *ports) as second:
            assert {what: second.addresses[what] for what in OPTIONS} == {
                what: first.addresses[what] for what in OPTIONS
            }
            after = next_of_another(subscriber, before.session)
            assert after.session == second.ask({"op": "hello"})["session"] != before.session
    finally:
        stopping.set()
        thread.join()
        sender.close()
        subscriber.close()
        first.stop(signal.SIGKILL)
