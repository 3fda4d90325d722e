"""Networks, and who of them may send."""

import ipaddress
from collections.abc import Sequence

MAX_ANSWERS = 256
Network = ipaddress.IPv4Network | ipaddress.IPv6Network


class AllowList:
    """Whether an address is in one of the networks; remembers the latest answers. None allows all."""

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
