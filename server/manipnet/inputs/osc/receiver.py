"""Receives OSC on a bound UDP socket with a thread of its own, and gathers each sender's messages into frames."""

import logging
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from manipnet.common.log_limits import LogThrottle
from manipnet.common.options import Network
from manipnet.inputs.base import Intake
from manipnet.inputs.declaration import Receiver
from manipnet.inputs.osc.addresses import AddressBook
from manipnet.inputs.osc.assembler import GAP_S, FrameAssembler
from manipnet.inputs.osc.packet import Packet, split_packet
from manipnet.inputs.osc.triggers import take_triggers
from manipnet.net.addresses import AllowList
from manipnet.net.flood_filter import FloodFilter, FloodWatch
from manipnet.net.rate_limit import SourceRateLimiter
from manipnet.net.supervised import ReceiverHealth
from manipnet.net.udp import Address, UdpThread, bind_udp
from manipnet.wire.bodies import BodyFrame, MessageError
from manipnet.wire.record_trigger import RecordTrigger

MAX_SENDERS = 16
DATAGRAMS_PER_S = 20_000
"""Datagrams read of one sender: a sender of loose messages needs three for each body."""
IDLE_S = 0.1
WORKING_S = 1.0
"""A sender whose messages have been of use within this time may send others that are not."""
REPORT_S, REPEAT_S = 2.0, 60.0
"""How often the senders that were heard since are looked at, and how often the same is reported again."""
_log = logging.getLogger(__name__)
_FLOOD = "more datagrams than are read, from one sender or from senders that are not known yet"


class OscBodies(Receiver):
    """Receives OSC on `host:port`. Port 0 takes any free port, which `address` names after `start`.

    Only addresses in the networks of `allow` may send; if there are none, any address may.
    """

    def __init__(
        self,
        intake: Intake,
        host: str = "127.0.0.1",
        port: int = 39540,
        allow: Sequence[Network] = (),
        book: AddressBook | None = None,
        record: Callable[[RecordTrigger], object] | None = None,
    ) -> None:
        """`record` takes the triggers of recordings; without it, they are not understood."""
        self._intake, self._record = intake, record
        self._book = book or AddressBook()
        self._log_throttle = LogThrottle(REPEAT_S)
        self._rate_limiter = SourceRateLimiter(DATAGRAMS_PER_S)
        self._allowed = AllowList(allow or None)
        self._host, self._port = host, port
        self._assemblers: dict[Address, FrameAssembler] = {}
        self._reported_s = float("-inf")
        self._thread: UdpThread | None = None
        self._flood: FloodWatch | None = None
        self.address = f"udp://{host}:{port}"

    def start(self) -> None:
        """Bind and begin to receive. Raises `ListenError`."""
        udp = self._open(self._port)
        host, port = udp.getsockname()[:2]
        self.address = f"udp://[{host}]:{port}" if ":" in host else f"udp://{host}:{port}"
        health = ReceiverHealth(self._intake.protocol, self._intake.telemetry)
        self._thread = UdpThread(udp, lambda: self._open(port), self.receive, self._idle, self._lost, health)
        self._thread.start()

    def stop(self) -> None:
        """Stop receiving and free the port. Does nothing if the receiver was not started."""
        if self._thread is not None:
            self._thread.stop()
            self._thread = None

    def status(self) -> dict[str, Any]:
        """What each sender's times and bodies are like, and which addresses arrive but are not used."""
        now_s = time.monotonic()
        return {
            "senders": {
                assembler.source: {
                    "age_s": max(now_s - assembler.heard_s, 0.0),
                    "clock": assembler.clock.report(),
                    "sends_changes_only": assembler.memory.sends_changes_only,
                    "halves": assembler.memory.halves(),
                    "conflicts": assembler.memory.conflicts(),
                }
                for assembler in list(self._assemblers.values())
            },
            "not_understood": self._book.ignored.report(now_s),
            "without_body": self._book.without_body.report(now_s),
        }

    def _open(self, port: int) -> socket.socket:
        udp = bind_udp(self._host, port)
        self._flood = FloodWatch(FloodFilter(udp))
        return udp

    def receive(self, datagram: bytes, sender: Address, now_s: float) -> None:
        """Take one datagram that `sender` has sent. Belongs to the thread of the socket."""
        if not self._rate_limiter.admits(sender, now_s):
            self._intake.drop("rate", "osc", _FLOOD)
            if self._flood is not None:
                self._flood.add()
            return
        if not self._allowed(sender[0]):
            self._rate_limiter.bad(sender)
            self._intake.drop("not_allowed", _name(sender), "its address is in no network of --allow")
            return
        assembler = self._assemblers.get(sender) or FrameAssembler(f"osc:{_name(sender)}", self._book)
        before = assembler.incomplete
        try:
            frames, useful, faults = assembler.add(self._without_triggers(split_packet(datagram), sender), now_s)
        except MessageError as error:
            frames, useful, faults = [], False, [str(error)]
        if useful:
            self._rate_limiter.good(sender)
            self._remember(sender, assembler)
        elif faults and now_s - assembler.heard_s > WORKING_S:
            self._rate_limiter.bad(sender)
        if faults:
            self._intake.drop("malformed", assembler.source, faults[0], len(faults))
        self._pass_on(assembler, frames, before)

    def _without_triggers(self, packet: Packet, sender: Address) -> Packet:
        if self._record is None:
            return packet
        packet, triggers = take_triggers(packet, f"osc:{_name(sender)}")
        for trigger in triggers:
            self._record(trigger)
        return packet

    def _remember(self, sender: Address, assembler: FrameAssembler) -> None:
        self._assemblers.pop(sender, None)
        if len(self._assemblers) >= MAX_SENDERS:
            del self._assemblers[next(iter(self._assemblers))]  # the sender that has been silent for longest
        self._assemblers[sender] = assembler

    def _idle(self, now_s: float) -> float:
        if self._flood is not None:
            self._flood.look(now_s, self._assemblers.keys())
        self._report(now_s)
        waiting = False
        for assembler in self._assemblers.values():
            if assembler.pending:
                before = assembler.incomplete
                self._pass_on(assembler, assembler.flush(now_s), before)
                waiting = waiting or assembler.pending
        return GAP_S if waiting else IDLE_S

    def _report(self, now_s: float) -> None:
        """Log what a sender sends that is of no use, once in a while."""
        if now_s - self._reported_s < REPORT_S:
            return
        self._reported_s = now_s
        for kind, line in self._complaints(now_s - REPORT_S):
            if self._log_throttle.admit(kind) is not None:
                _log.warning("%s", line)

    def _complaints(self, since_s: float) -> Iterator[tuple[str, str]]:
        """What is wrong with the senders that were heard since then: the kind of the complaint, a line for the log."""
        working = [each for each in self._assemblers.values() if each.heard_s >= since_s]
        useful = {each.source for each in working}
        for source, addresses in self._book.ignored.by_source(since_s).items():
            if source not in useful:
                yield (
                    "address",
                    f"{source} sends addresses that are not understood: {', '.join(addresses[:8])}; a rig file can "
                    "declare them ([[server.osc_address]], docs/protocol-in.md)",
                )
        for source, addresses in self._book.without_body.by_source(since_s).items():
            if source not in useful:
                yield "body", f"{source} sends {', '.join(addresses)}, which hold no tracked body"
        for sender in working:
            for name, fault in sender.clock.set_aside().items():
                yield name, f"{sender.source}: its {name} {fault}, so the {sender.clock.used} gives the times"
            for body, missing in sender.memory.halves().items():
                yield "half", f"{sender.source}: body {body} is not used, because its {missing} never arrives"
            for body in sender.memory.conflicts():
                yield "key", f"{sender.source}: two bodies have the key {body}, so neither is used; rename one of them"

    def _pass_on(self, assembler: FrameAssembler, frames: list[BodyFrame], incomplete_before: int) -> None:
        if lost := assembler.incomplete - incomplete_before:
            self._intake.drop("incomplete", assembler.source, "a frame has no time stamp, or too many bodies", lost)
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
