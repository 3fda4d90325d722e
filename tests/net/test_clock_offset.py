"""Clock offsets from simulated exchanges, where the truth is known, and over a real loopback socket."""

import socket
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from manipnet.net.clock_offset import MAX_DRIFT, ClockProbes, measure_offset

delay = st.floats(1e-6, 0.2)


@given(
    offset=st.floats(-1e6, 1e6),
    delays=st.lists(st.tuples(delay, delay), min_size=1, max_size=20),
    drift=st.floats(-MAX_DRIFT, MAX_DRIFT),
)
def test_the_truth_is_within_the_uncertainty(offset, delays, drift):
    probes = ClockProbes()
    now = 0.0
    for there, back in delays:
        sent, read, now = now, now + there, now + there + back
        probes.add(sent, read * (1 + drift) + offset, now)
        now += 0.5
    best = probes.best(now)
    assert best is not None
    truth = now * (1 + drift) + offset - now
    assert abs(best.offset_s - truth) <= best.uncertainty_s + 1e-7 + MAX_DRIFT * max(map(sum, delays))


def test_the_smallest_round_trip_counts():
    probes = ClockProbes()
    for round_trip in (0.1, 0.001, 0.05):
        probes.add(0.0, 5.0, round_trip)
    best = probes.best(0.1)
    assert best is not None
    assert best.uncertainty_s == pytest.approx(0.0005, abs=1.1e-5)


def test_a_newer_probe_replaces_an_old_one():
    probes = ClockProbes()
    probes.add(0.0, 10.0, 0.001)
    probes.add(100.0, 111.0, 100.004)
    best = probes.best(100.0)
    assert best is not None
    assert best.offset_s == pytest.approx(11.0, abs=0.01)


def test_without_probes_there_is_no_offset():
    probes = ClockProbes()
    assert probes.best(0.0) is None
    probes.add(1.0, 5.0, 0.5)  # received before it was sent: not an exchange
    assert probes.best(0.0) is None
    probes.add(0.0, 5.0, 0.5)
    probes.clear()
    assert probes.best(0.0) is None


def test_offset_over_loopback():
    offset_s = 1_234.5
    server = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    server.bind(("127.0.0.1", 0))

    def answer():
        while (request := server.recvfrom(64))[0]:
            server.sendto(repr(time.monotonic() + offset_s).encode(), request[1])

    thread = threading.Thread(target=answer)
    thread.start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.settimeout(20)
        client.connect(server.getsockname())

        def ping():
            client.send(b"ping")
            return float(client.recv(64))

        measured = measure_offset(ping, time.monotonic)
        client.send(b"")
    thread.join()
    server.close()
    assert abs(measured.offset_s - offset_s) <= measured.uncertainty_s
