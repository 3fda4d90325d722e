"""How far a remote clock is from ours: ping exchanges, of which the one with the smallest round trip counts.

The idea is NTP's: the remote clock is read somewhere between our sending and our receiving, so the middle of the
two is off by at most half the round trip.
"""

from collections.abc import Callable
from dataclasses import dataclass

PROBES = 8
MAX_DRIFT = 1e-4
"""Two quartz clocks part by at most this fraction (100 ppm), so an old probe is worth less."""


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """`offset_s` is the remote clock less ours; the truth is within `± uncertainty_s` of it."""

    offset_s: float
    uncertainty_s: float


class ClockProbes:
    """The newest exchanges with one remote clock. Pure: all times are arguments, in seconds.

    One thread may add while others read: what they read is replaced, never changed.
    """

    def __init__(self, keep: int = PROBES) -> None:
        self._keep = keep
        self._probes: tuple[tuple[float, ClockOffset], ...] = ()

    def add(self, sent_s: float, remote_s: float, received_s: float) -> None:
        """One exchange: our clock at sending and receiving, the remote one's reading in between."""
        if received_s >= sent_s:
            offset = ClockOffset(remote_s - (sent_s + received_s) / 2.0, (received_s - sent_s) / 2.0)
            self._probes = (*self._probes, (received_s, offset))[-self._keep :]

    def clear(self) -> None:
        """Forget all: the remote clock has started anew."""
        self._probes = ()

    def best(self, now_s: float) -> ClockOffset | None:
        """The surest offset at `now_s`, None before the first probe."""
        aged = [
            ClockOffset(probe.offset_s, probe.uncertainty_s + MAX_DRIFT * max(now_s - received_s, 0.0))
            for received_s, probe in self._probes
        ]
        return min(aged, key=lambda offset: offset.uncertainty_s, default=None)


def measure_offset(ping: Callable[[], float], clock: Callable[[], float], probes: int = PROBES) -> ClockOffset:
    """Offset to the remote clock that `ping` reads, in `probes` exchanges; raises what `ping` raises."""
    exchanges = ClockProbes(probes)
    for _ in range(probes):
        sent_s = clock()
        remote_s = ping()
        exchanges.add(sent_s, remote_s, clock())
    best = exchanges.best(clock())
    if best is None:
        raise ValueError(f"no exchange in {probes} probes; at least one is needed")
    return best
