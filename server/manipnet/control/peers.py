"""The connected senders and clients of a server, and their clocks, for the request `status` and for the metrics."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from manipnet.control.request import Handler, Request, RequestError, number
from manipnet.inputs.declaration import Receiver
from manipnet.inputs.sender_stats import SenderStats
from manipnet.runtime.diagnosis.diagnose import diagnose
from manipnet.telemetry import Gauge
from manipnet.wire.bodies import MessageError, check_name

MOST_CLOCKS: Final = 64
MAX_OFFSET_S: Final = 1e10


class Peers:
    """Reports who is connected to a server. From any thread."""

    def __init__(self, senders: SenderStats) -> None:
        self.senders = senders
        self.receivers: Mapping[str, Receiver] = {}
        """The receivers by their names in `status`."""
        self.connected: Callable[[], Mapping[str, int]] = dict
        """The numbers of connected clients by the name of their socket."""
        self._lock = threading.Lock()
        self._clocks: dict[str, tuple[float, float, float]] = {}

    def handlers(self, status: Handler) -> dict[str, Handler]:
        """The operations `ping` and `status`; the latter adds the peers to the answer of the given handler."""
        return {"ping": self._ping, "status": lambda request: self._diagnosed({**status(request), **self.report()})}

    @staticmethod
    def _diagnosed(report: dict[str, Any]) -> dict[str, Any]:
        """A report with what is wrong with it, as `manipnet doctor` shows it."""
        return {**report, "doctor": [finding.as_map() for finding in diagnose(report)]}

    def gauges(self) -> Iterator[Gauge]:
        """What is measured at this moment."""
        yield "connections", "socket", self._connections()

    def _connections(self) -> dict[str, int]:
        senders = {name: receiver.connected() for name, receiver in self.receivers.items()}
        return {**self.connected(), **{name: count for name, count in senders.items() if count is not None}}

    def _ping(self, request: Request) -> dict[str, Any]:
        """Answer with the server's monotonic clock; a client may tell how far its own clock is from it."""
        now_s = time.monotonic()
        if "name" in request:
            try:
                name = check_name(request["name"], "name")
            except MessageError as error:
                raise RequestError(str(error)) from None
            offset_s = number(request, "offset", -MAX_OFFSET_S, MAX_OFFSET_S)
            uncertainty_s = number(request, "uncertainty", 0.0, MAX_OFFSET_S)
            with self._lock:
                self._clocks.pop(name, None)
                if len(self._clocks) >= MOST_CLOCKS:
                    del self._clocks[next(iter(self._clocks))]
                self._clocks[name] = (offset_s, uncertainty_s, now_s)
        return {"t": now_s}

    def report(self) -> dict[str, Any]:
        """The senders, the receivers with their addresses, the connections and the clocks of clients."""
        now_s = time.monotonic()
        report: dict[str, Any] = {"senders": self.senders.report(now_s), "connections": self._connections()}
        report["listening"] = {name: receiver.address for name, receiver in self.receivers.items()}
        with self._lock:
            report["clocks"] = {
                name: {"clock_offset_s": offset_s, "clock_uncertainty_s": uncertainty_s, "age_s": now_s - at_s}
                for name, (offset_s, uncertainty_s, at_s) in self._clocks.items()
            }
        for name, receiver in self.receivers.items():
            status = receiver.status()
            if status is not None:
                report[name] = status
                _use_measured_clock(report["senders"], name, status)
        return report


def _use_measured_clock(senders: Mapping[str, dict[str, Any]], protocol: str, status: Mapping[str, Any]) -> None:
    """Prefer the clock offset that a receiver measures itself to the one that one-way traffic gives."""
    if status.get("capture_offset_s") is None:
        return
    measured = {"clock_offset_s": status["capture_offset_s"], "clock_uncertainty_s": status["clock_uncertainty_s"]}
    for source, sender in senders.items():
        if source.startswith(f"{protocol}:"):
            sender |= measured
