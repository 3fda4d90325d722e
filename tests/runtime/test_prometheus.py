"""The page of metrics: who may read it, and that connections without a request take nothing away."""

import http.client
import socket
from contextlib import ExitStack, suppress
from urllib.parse import urlsplit

import pytest

from manipnet.net.small_http import MAX_REQUEST_BYTES, MOST_CONNECTIONS
from manipnet.runtime.prometheus import MetricsPage


@pytest.fixture
def page(telemetry):
    page = MetricsPage("127.0.0.1", 0, telemetry)
    yield page
    page.close()


def get(page, host: str | None = None) -> tuple[int, str]:
    address = urlsplit(page.address)
    connection = http.client.HTTPConnection(address.netloc, timeout=20)
    connection.request("GET", address.path, headers={} if host is None else {"Host": host})
    response = connection.getresponse()
    text = response.read().decode()
    connection.close()
    return response.status, text


@pytest.mark.parametrize("host", [None, "localhost:9000", "127.0.0.1", "[::1]:80"])
def test_this_machine_may_read_the_counters(page, telemetry, host):
    telemetry.count("frames_dropped", reason="late")
    status, text = get(page, host)
    assert status == 200
    assert 'manipnet_frames_dropped_total{reason="late"} 1.0' in text


@pytest.mark.parametrize(
    "host", ["evil.test", "127.0.0.1.evil.test", "127.0.0.1@evil.test", "localhost.evil.test", "["]
)
def test_a_foreign_page_that_was_rebound_to_this_machine_may_not(page, host):
    assert get(page, host)[0] == 403


@pytest.mark.slow
def test_a_crowd_that_sends_nothing_keeps_nobody_out(page):
    address = urlsplit(page.address)
    with ExitStack() as crowd:
        for _ in range(10 * MOST_CONNECTIONS):
            crowd.enter_context(socket.create_connection((address.hostname, address.port), 20)).sendall(b"GET ")
        assert get(page)[0] == 200
        assert page._server.connected() <= MOST_CONNECTIONS


def test_other_methods_and_long_requests_are_refused(page):
    address = urlsplit(page.address)
    connection = http.client.HTTPConnection(address.netloc, timeout=20)
    connection.request("POST", "/metrics", body=b"x")
    assert connection.getresponse().status == 405
    connection.close()
    with socket.create_connection((address.hostname, address.port), 20) as tcp:
        tcp.sendall(b"x" * (MAX_REQUEST_BYTES + 1))
        with suppress(ConnectionError):
            assert tcp.recv(1) == b""
    assert get(page)[0] == 200
