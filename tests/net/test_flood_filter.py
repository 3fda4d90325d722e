"""The kernel's packet filter on a real socket, and when it is engaged."""

import socket
import sys

import pytest

from manipnet.net.flood_filter import FLOOD_PER_S, MAX_KNOWN, FloodFilter, FloodWatch, program

linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux filters datagrams in the kernel")


@pytest.fixture
def sockets():
    """A receiver and two senders connected to it."""
    made = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(3)]
    for udp in made:
        udp.bind(("127.0.0.1", 0))
        udp.setblocking(False)
    for udp in made[1:]:
        udp.connect(made[0].getsockname())
    yield made
    for udp in made:
        udp.close()


def passed(receiver, *senders):
    """How many of the 100 datagrams of each sender arrive."""
    for _ in range(100):
        for n, sender in enumerate(senders):
            sender.send(bytes([n]))
    counts = [0] * len(senders)
    while True:
        try:
            counts[receiver.recv(8)[0]] += 1
        except BlockingIOError:
            return counts


@linux
def test_known_senders_pass_and_unknown_ones_do_not(sockets):
    receiver, known, stranger = sockets
    kernel = FloodFilter(receiver)
    assert kernel.engage([("10.0.0.1", 5), known.getsockname()], 0.0)
    assert passed(receiver, known, stranger) == [100, 0]
    kernel.release()
    assert passed(receiver, known, stranger) == [100, 100]


@linux
def test_a_share_of_the_unknown_senders_passes(sockets):
    receiver, _, stranger = sockets
    kernel = FloodFilter(receiver)
    kernel.engage([], 0.5)
    (count,) = passed(receiver, stranger)
    assert 10 < count < 90
    kernel.engage([], 1.0)
    assert passed(receiver, stranger) == [100]


def test_the_program_is_bounded():
    many = [(f"10.0.0.{n}", n) for n in range(200)]
    assert len(program(many[-MAX_KNOWN:], 0.1)) == 8 * (5 * MAX_KNOWN + 4)


class Recorder(FloodFilter):
    """Stands in for the kernel and notes the calls."""

    def __init__(self):
        self.engaged, self.shares = False, []

    def engage(self, known, share):
        self.engaged = True
        self.shares.append(share)
        return True

    def release(self):
        self.engaged = False


def test_the_filter_is_engaged_while_the_flood_lasts():
    kernel = Recorder()
    watch = FloodWatch(kernel)
    states = []
    for second, unread in enumerate([0, 100, 50_000, 50_000, FLOOD_PER_S - 100, 100, 0]):
        watch.add(unread)
        watch.look(float(second), [])
        states.append(kernel.engaged)
    assert states == [False, False, True, True, True, True, False]
    assert kernel.shares == [FLOOD_PER_S / 50_000] * 2


def test_a_sender_that_becomes_known_in_a_flood_passes_at_once():
    kernel = Recorder()
    watch = FloodWatch(kernel)
    watch.look(0.0, [])
    watch.add(50_000)
    watch.look(1.0, [])
    watch.look(1.1, [("10.0.0.1", 5)])
    watch.look(1.2, [("10.0.0.1", 5)])
    assert kernel.shares == [FLOOD_PER_S / 50_000] * 2
