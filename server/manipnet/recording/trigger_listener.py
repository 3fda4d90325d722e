"""Listens for Motive's remote trigger: XML datagrams that say when it records, and under which name."""

import logging
import socket
from collections.abc import Callable, Sequence
from typing import Final

from manipnet.common.log_limits import LogThrottle
from manipnet.common.options import Network
from manipnet.net.addresses import AllowList
from manipnet.net.supervised import ReceiverHealth
from manipnet.net.udp import Address, UdpThread, bind_udp
from manipnet.recording.capture_xml import CaptureError, parse_capture
from manipnet.telemetry import Telemetry
from manipnet.wire.record_trigger import RecordTrigger

MOST_PER_S: Final = 50
"""Datagrams that are read in a second. A trigger comes once a take."""
IDLE_S: Final = 0.25
LOG_PERIOD_S: Final = 5.0
_log = logging.getLogger(__name__)


class TriggerListener:
    """Passes triggers on to `sink`. A datagram that is wrong costs only itself, and is counted with its reason."""

    def __init__(
        self,
        host: str,
        port: int,
        allow: Sequence[Network],
        sink: Callable[[RecordTrigger], object],
        telemetry: Telemetry,
    ) -> None:
        """Listen on `host:port`, where port 0 takes any free port. Raises `ListenError`.

        Only addresses in the networks of `allow` may send; if there are none, any address may.
        """
        self._host, self._sink, self._telemetry = host, sink, telemetry
        self._allowed = AllowList(allow or None)
        self._log_throttle = LogThrottle(LOG_PERIOD_S)
        self._second, self._in_second = 0, 0
        udp = bind_udp(host, port)
        host, port = udp.getsockname()[:2]
        self.address = f"udp://[{host}]:{port}" if ":" in host else f"udp://{host}:{port}"
        health = ReceiverHealth("trigger", telemetry)
        self._thread = UdpThread(udp, lambda: self._open(port), self._receive, lambda _: IDLE_S, self._lost, health)
        self._thread.start()

    def close(self) -> None:
        """Stop listening."""
        self._thread.stop()

    def _open(self, port: int) -> socket.socket:
        return bind_udp(self._host, port)

    def _receive(self, datagram: bytes, sender: Address, now_s: float) -> None:
        source = f"{sender[0]}:{sender[1]}"
        try:
            if not self._allowed(sender[0]):
                raise CaptureError("not_allowed", "its address is in no network of --allow")
            if not self._admits(now_s):
                raise CaptureError("rate", f"more than {MOST_PER_S} datagrams came within a second")
            trigger = parse_capture(datagram, source)
        except CaptureError as error:
            self._telemetry.count("triggers_refused", reason=error.reason)
            held_back = self._log_throttle.admit(error.reason)
            if held_back is not None:
                more = f" ({held_back} more since the last line)" if held_back else ""
                _log.warning("a trigger of %s is refused (%s): %s%s", source, error.reason, error, more)
        else:
            self._sink(trigger)

    def _admits(self, now_s: float) -> bool:
        if int(now_s) != self._second:
            self._second, self._in_second = int(now_s), 0
        self._in_second += 1
        return self._in_second <= MOST_PER_S

    def _lost(self, count: int) -> None:
        self._telemetry.count("triggers_refused", count, reason="rate")
