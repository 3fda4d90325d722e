"""The helpers of the tests and the Python client, for all measurements. This module alone extends the search path."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests" / "support"), str(ROOT / "clients" / "python")]

from avatar_profiles import scaled_profile  # noqa: E402
from browser import browsing  # noqa: E402
from fake_motive import FakeMotive  # noqa: E402
from languages import LiveClient, build  # noqa: E402
from live_server import LiveServer, Subscriber, serving  # noqa: E402
from manipnet_client import Client  # noqa: E402
from simulated_display import RATE_HZ, peak_acceleration, play, source, turn_about_z  # noqa: E402
from simulated_link import LinkQuality, Proxy, UdpProxy, ZmqProxy  # noqa: E402

__all__ = [
    "RATE_HZ",
    "ROOT",
    "Client",
    "FakeMotive",
    "LinkQuality",
    "LiveClient",
    "LiveServer",
    "Proxy",
    "Subscriber",
    "UdpProxy",
    "ZmqProxy",
    "browsing",
    "build",
    "peak_acceleration",
    "play",
    "scaled_profile",
    "serving",
    "source",
    "turn_about_z",
]
