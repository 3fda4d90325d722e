"""Addresses: which ones may send, and which ones only this machine can reach."""

import ipaddress
from collections.abc import Sequence
from urllib.parse import urlsplit

from manipnet.common.options import Network

MAX_ANSWERS = 256


class AllowList:
    """Says whether an address is in one of the networks; None allows every address. Remembers the latest answers."""

    def __init__(self, networks: Sequence[Network] | None) -> None:
        self._networks = networks
        self._answers: dict[str, bool] = {}

    def __call__(self, host: str) -> bool:
        if self._networks is None:
            return True
        if host not in self._answers:
            if len(self._answers) >= MAX_ANSWERS:
                self._answers.clear()
            address = ipaddress.ip_address(host.partition("%")[0])
            self._answers[host] = any(address in network for network in self._networks)
        return self._answers[host]


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach `host`."""
    try:
        address = ipaddress.ip_address(host)
        return (getattr(address, "ipv4_mapped", None) or address).is_loopback
    except ValueError:
        return host == "localhost"


def is_own_name(host: str) -> bool:
    """Whether an HTTP header `Host` names this machine itself, so that no foreign page reached it by a name of its own.

    Such a page is served under a name whose address is changed to this machine's later (DNS rebinding).
    """
    try:
        return is_loopback(urlsplit(f"http://{host}").hostname or "")
    except ValueError:
        return False
