"""Bodies over OSC: a bound UDP socket with its own thread, every sender's messages gathered into frames."""

from collections.abc import Sequence

from manipnet.inputs.base import Intake, Sink
from manipnet.inputs.osc.assembler import GAP_S, FrameAssembler
from manipnet.inputs.osc.packet import split_packet
from manipnet.net.addresses import AllowList, Network
from manipnet.net.flood_filter import FloodFilter, FloodWatch
from manipnet.net.rate_limit import SourceRateLimiter
from manipnet.net.udp import Address, UdpThread, bind_udp
from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import BodyFrame, MessageError

MAX_SENDERS = 16
DATAGRAMS_PER_S = 20_000
"""Of one sender: loose messages make three datagrams of a body."""
IDLE_S = 0.1
_FLOOD = "more datagrams than are read, of one sender or of those unknown so far"


class OscBodies:
    """Receives OSC on `host:port`; port 0 takes a free one, see `address` after `start`.

    `allow` names the networks that may send; None means any that reaches the socket.
    """

    def __init__(
        self,
        sink: Sink,
        telemetry: Telemetry,
        host: str = "127.0.0.1",
        port: int = 39540,
        allow: Sequence[Network] | None = None,
    ) -> None:
        self._intake = Intake("osc", sink, telemetry)
        self._guard = SourceRateLimiter(DATAGRAMS_PER_S)
        self._allowed = AllowList(allow)
        self._host, self._port = host, port
        self._assemblers: dict[Address, FrameAssembler] = {}
        self._thread: UdpThread | None = None
        self._flood: FloodWatch | None = None
        self.address = f"udp://{host}:{port}"

    def start(self) -> None:
        """Bind and begin to receive; raises `ListenError` when the address cannot be bound."""
        udp = bind_udp("OSC", self._host, self._port)
        host, port = udp.getsockname()[:2]
        self.address = f"udp://[{host}]:{port}" if ":" in host else f"udp://{host}:{port}"
        self._flood = FloodWatch(FloodFilter(udp))
        self._thread = UdpThread(udp, self._receive, self._idle, self._lost)
        self._thread.start()

    def stop(self) -> None:
        """Stop receiving and free the port; returns when both are done. Harmless when not started."""
        if self._thread is not None:
            self._thread.stop()
            self._thread = None

    def _receive(self, datagram: bytes, sender: Address, now_s: float) -> None:
        if not self._guard.admits(sender, now_s):
            self._intake.drop("rate", "osc", _FLOOD)
            if self._flood is not None:
                self._flood.add()
            return
        if not self._allowed(sender[0]):
            self._guard.bad(sender)
            self._intake.drop("not_allowed", _name(sender), "the address is not on the allow-list for OSC")
            return
        assembler = self._assemblers.get(sender) or FrameAssembler(f"osc:{_name(sender)}")
        before = assembler.incomplete
        try:
            frames, ours = assembler.add(split_packet(datagram), now_s)
        except MessageError as error:
            self._guard.bad(sender)
            self._intake.drop("malformed", assembler.source, error)
            return
        if ours:
            self._guard.good(sender)
            self._remember(sender, assembler)
        self._pass_on(assembler, frames, before)

    def _remember(self, sender: Address, assembler: FrameAssembler) -> None:
        self._assemblers.pop(sender, None)
        if len(self._assemblers) >= MAX_SENDERS:
            del self._assemblers[next(iter(self._assemblers))]  # the one not heard for longest
        self._assemblers[sender] = assembler

    def _idle(self, now_s: float) -> float:
        if self._flood is not None:
            self._flood.look(now_s, self._assemblers.keys())
        waiting = False
        for assembler in self._assemblers.values():
            if assembler.pending:
                before = assembler.incomplete
                self._pass_on(assembler, assembler.flush(now_s), before)
                waiting = waiting or assembler.pending
        return GAP_S if waiting else IDLE_S

    def _pass_on(self, assembler: FrameAssembler, frames: list[BodyFrame], incomplete_before: int) -> None:
        if lost := assembler.incomplete - incomplete_before:
            self._intake.drop("incomplete", assembler.source, "a frame without its time stamp", lost)
        for frame in frames:
            self._intake.accept(frame)

    def _lost(self, count: int) -> None:
        if self._flood is not None and self._flood.engaged:
            self._flood.add(count)
            self._intake.drop("rate", "osc", _FLOOD, count)
        else:
            self._intake.drop("kernel", "osc", "the socket's buffer was full", count)


def _name(sender: Address) -> str:
    return f"{sender[0]}:{sender[1]}"
