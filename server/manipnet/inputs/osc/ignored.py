"""Counts the OSC messages that are not used, by their address."""

from typing import Final

from manipnet.inputs.sender_stats import RATE_S
from manipnet.wire.text import read_text

MOST_ADDRESSES: Final = 64
OTHERS: Final = "other addresses"
_MAX_SHOWN: Final = 96


class IgnoredAddresses:
    """Which addresses arrive and are not used, how often, and from whom. The number of addresses is bounded."""

    def __init__(self) -> None:
        self._noted: dict[str, IgnoredAddress] = {}

    def note(self, raw: bytes, form: str, source: str, now_s: float) -> None:
        """Note a message of `source` with this address; `form` is a word among its arguments that tells its form."""
        self.entry(raw, form).note(source, now_s)

    def entry(self, raw: bytes, form: str = "") -> "IgnoredAddress":
        """What is known about an address, or about all others if there are too many."""
        address = read_text(raw[:_MAX_SHOWN]) + (f" … {form}" if form else "")
        if not address.isprintable():
            address = ascii(address)
        if address not in self._noted and len(self._noted) >= MOST_ADDRESSES:
            address = OTHERS
        return self._noted.setdefault(address, IgnoredAddress())

    def report(self, now_s: float) -> dict[str, dict[str, object]]:
        """By address: `count`, `rate_hz`, `age_s`, and the `source` of the newest message. From any thread."""
        return {address: noted.report(now_s) for address, noted in list(self._noted.items()) if noted.count}

    def by_source(self, since_s: float) -> dict[str, list[str]]:
        """The addresses that arrived since then, by the sender of their newest message. From any thread."""
        found: dict[str, list[str]] = {}
        for address, noted in list(self._noted.items()):
            if noted.newest_s >= since_s:
                found.setdefault(noted.source, []).append(address)
        return found


class IgnoredAddress:
    """How often one address arrived, when, and from whom."""

    __slots__ = ("count", "first_s", "newest_s", "source")

    def __init__(self) -> None:
        self.count, self.first_s, self.newest_s, self.source = 0, 0.0, float("-inf"), ""

    def note(self, source: str, now_s: float) -> None:
        """Note a message of `source`."""
        if not self.count:
            self.first_s = now_s
        self.count += 1
        self.newest_s, self.source = now_s, source

    def report(self, now_s: float) -> dict[str, object]:
        """As a part of `IgnoredAddresses.report`."""
        passed_s, age_s = self.newest_s - self.first_s, max(now_s - self.newest_s, 0.0)
        return {
            "count": self.count,
            "rate_hz": (self.count - 1) / passed_s if passed_s > 0.0 and age_s <= RATE_S else 0.0,
            "age_s": age_s,
            "source": self.source,
        }
