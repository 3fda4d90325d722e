"""The offset of a remote clock from ours, from ping exchanges, of which the one with the shortest round trip counts.

As in NTP, the remote clock is read at some time between our sending and our receiving, so the middle of the two is off
by at most half the round trip.
"""

from collections.abc import Callable
from dataclasses import dataclass

PROBES = 8
MAX_DRIFT = 1e-4
"""Two quartz clocks drift apart by at most this fraction (100 ppm), so an old probe is less certain."""


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """`offset_s` is the remote clock minus ours. The true offset is within `± uncertainty_s` of it."""

    offset_s: float
    uncertainty_s: float


class ClockProbes:
    """The newest exchanges with one remote clock. Reads no clock: all times are arguments, in seconds.

    One thread may add probes while others read, since the probes are replaced as a whole.
    """

    def __init__(self, keep: int = PROBES) -> None:
        self._keep = keep
        self._probes: tuple[tuple[float, ClockOffset], ...] = ()

    def add(self, sent_s: float, remote_s: float, received_s: float) -> None:
        """Add an exchange: our clock when we sent and received, and the remote clock in between."""
        if received_s >= sent_s:
            offset = ClockOffset(remote_s - (sent_s + received_s) / 2.0, (received_s - sent_s) / 2.0)
            self._probes = (*self._probes, (received_s, offset))[-self._keep :]

    def clear(self) -> None:
        """Forget all exchanges, since the remote clock has been restarted."""
        self._probes = ()

    def best(self, now_s: float) -> ClockOffset | None:
        """The offset with the least uncertainty at `now_s`, or None before the first probe."""
        aged = [
            ClockOffset(probe.offset_s, probe.uncertainty_s + MAX_DRIFT * max(now_s - received_s, 0.0))
            for received_s, probe in self._probes
        ]
        return min(aged, key=lambda offset: offset.uncertainty_s, default=None)


def measure_offset(ping: Callable[[], float], clock: Callable[[], float], probes: int = PROBES) -> ClockOffset:
    """The offset of the remote clock that `ping` reads, from `probes` exchanges. Raises what `ping` raises."""
    exchanges = ClockProbes(probes)
    for _ in range(probes):
        sent_s = clock()
        remote_s = ping()
        exchanges.add(sent_s, remote_s, clock())
    best = exchanges.best(clock())
    if best is None:
        raise ValueError(f"{probes} probes gave no exchange; at least one is needed")
    return best
