"""A client of OptiTrack Motive: it connects, learns the version and the bodies' names, and keeps the stream alive."""

import functools
import logging
import socket
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from manipnet.common.options import Network
from manipnet.inputs.base import Intake
from manipnet.inputs.declaration import Receiver
from manipnet.inputs.natnet.definitions import read_definitions
from manipnet.inputs.natnet.frames import MocapFrame, RigidBody, read_frame
from manipnet.inputs.natnet.names import Names
from manipnet.inputs.natnet.options import NatNetOptions
from manipnet.inputs.natnet.protocol import (
    MULTICAST_GROUP,
    MessageId,
    ServerInfo,
    check_version,
    connect_payload,
    read_echo,
    read_packet,
    read_server_info,
    write_packet,
)
from manipnet.inputs.sender_clock import SenderClock
from manipnet.inputs.timecode_rate import TimecodeRate
from manipnet.net.addresses import AllowList
from manipnet.net.clock_offset import ClockProbes
from manipnet.net.errors import ListenError
from manipnet.net.rate_limit import SourceRateLimiter
from manipnet.net.supervised import ReceiverHealth
from manipnet.net.udp import Address, UdpThread, bind_udp, join_multicast, local_address_towards
from manipnet.telemetry import Gauge
from manipnet.wire.bodies import CONFLICT, MAX_BODIES, BodyFrame, BodySample, MessageError, make_sample

CONNECT_S = 1.0
"""How often the client asks a server that sends no frames to connect."""
KEEP_ALIVE_S = 1.0
ECHO_S = 1.0
SILENT_S = 3.0
"""A server that has sent nothing for this long counts as gone, and is asked to connect again."""
CHORES_S = 0.1
MOST_REPORTED = 64

STATES = ("connecting", "connected", "streaming", "silent")
_STREAMS_MULTICAST = (
    "the server streams multicast: start with --multicast, or choose Unicast as Transmission Type in Motive's "
    "streaming settings"
)
_log = logging.getLogger(__name__)


class NatNetBodies(Receiver):
    """A NatNet client of the server that `options` name, by unicast or multicast.

    Datagrams from other hosts are refused, except frames from the networks in `allow`, for a Motive with two network
    cards. Without an interface in `options`, the system's choice towards the server is taken.
    """

    def __init__(
        self,
        intake: Intake,
        options: NatNetOptions,
        allow: Sequence[Network] = (),
        bodies: frozenset[int | str] = frozenset(),
    ) -> None:
        """`bodies` are those of the rig, which help with names that are not written in UTF-8."""
        assert options.natnet is not None
        self._intake = intake
        self._rate_limiter, self._allowed = SourceRateLimiter(), AllowList(allow)
        self._host, self._port = options.natnet
        self._multicast, self._interface, self._up = options.multicast, options.interface, options.up
        self._server: Address = options.natnet
        self._command: UdpThread | None = None
        self._data: UdpThread | None = None
        self._info: ServerInfo | None = None
        self._names, self._expected = Names(), bodies
        self._twice: tuple[int, ...] = ()
        """The streaming ids that occurred twice in the newest frame."""
        self._timecode_rate = TimecodeRate()
        self._sender_clock = SenderClock(("time stamp",))
        self._unused: Mapping[str, int] = {}
        self._nameless_bones = self._bones_left_out = 0
        self._reported: set[str] = set()
        self._clock = ClockProbes()
        self._stamps_ahead_s: float | None = None
        self._heard_s = self._framed_s = float("-inf")
        self._done_s: dict[str, float] = {}
        self._echo_stamp = 0
        self._problem: str | None = None
        self.address = f"natnet://{self._host}:{self._port}"

    def start(self) -> None:
        """Open the command socket and begin to connect. Raises `ListenError` for a wrong host or interface."""
        try:
            resolved = socket.getaddrinfo(self._host, self._port, socket.AF_INET, socket.SOCK_DGRAM)
        except (OSError, UnicodeError) as error:
            raise ListenError(
                f"cannot find the NatNet server {self._host!r}: {error}; name the address of Motive's machine"
            ) from None
        self._server = (str(resolved[0][4][0]), self._port)
        self._interface = self._interface or local_address_towards(*self._server)
        interface, health = self._interface, ReceiverHealth("natnet", self._intake.telemetry)
        self._command = UdpThread(
            bind_udp(interface, 0),
            lambda: bind_udp(interface, 0),
            self.receive,
            self._do_chores,
            self._lost,
            health,
        )
        self._command.start()

    def stop(self) -> None:
        """Disconnect from the server and close the sockets. Does nothing if the client was not started."""
        if self._command is not None:
            self._send(MessageId.DISCONNECT)
            self._command.stop()
            self._command = None
        if self._data is not None:
            self._data.stop()
            self._data = None

    def status(self) -> dict[str, Any]:
        """The state, the server, what it streams, what is wrong, and two offsets from this machine's clock.

        `unused` is what is in the frames beside rigid bodies and bones, and `conflicts` says which names or ids are
        ambiguous.
        `clock_offset_s` is the offset of the server's clock, and `capture_offset_s` that of the frames' times, which
        are those of the exposure.
        """
        now_s = time.monotonic()
        info, offset, ahead_s = self._info, self._clock.best(now_s), self._stamps_ahead_s
        return {
            "state": self._state(now_s),
            "server": None if info is None else f"{info.application}, NatNet {info.version[0]}.{info.version[1]}",
            "bodies": {str(id): name for id, name in self._names.definitions.bodies},
            "bones": list(self._names.definitions.bones.values()),
            "unused": self._unused_now(),
            "conflicts": self._conflicts(),
            "clock": self._sender_clock.report(),
            "clock_offset_s": None if offset is None else offset.offset_s,
            "clock_uncertainty_s": None if offset is None else offset.uncertainty_s,
            "capture_offset_s": None if offset is None or ahead_s is None else offset.offset_s + ahead_s,
            "problem": self._problem,
        }

    def _unused_now(self) -> dict[str, int]:
        bones = {"bones without a name": self._nameless_bones, "bones beyond the limit": self._bones_left_out}
        return {**self._unused, **{what: count for what, count in bones.items() if count}}

    def gauges(self) -> Iterator[Gauge]:
        """The state and the clock offsets."""
        status = self.status()
        yield "natnet_state", "state", {state: float(state == status["state"]) for state in STATES}
        for name in ("clock_offset", "clock_uncertainty", "capture_offset"):
            value = status[f"{name}_s"]
            yield f"{name}_seconds", "clock", {} if value is None else {"natnet": value}

    def _state(self, now_s: float) -> str:
        if self._info is None:
            return "connecting"
        if now_s - self._heard_s > SILENT_S:
            return "silent"
        return "streaming" if now_s - self._framed_s <= SILENT_S else "connected"

    # Chores of the command thread

    def _do_chores(self, now_s: float) -> float:
        # A server that was restarted answers echoes but has forgotten its unicast clients, so frames are what counts.
        if now_s - self._framed_s > SILENT_S and self._is_due("connect", now_s, CONNECT_S):
            self._send(MessageId.CONNECT, connect_payload("ManipNet Live"))
        if self._info is None:
            return CHORES_S
        if self._names.should_ask(now_s, CONNECT_S):
            self._send(MessageId.MODEL_REQUEST)
        if not self._multicast and self._is_due("keep alive", now_s, KEEP_ALIVE_S):
            self._send(MessageId.KEEP_ALIVE)
        if self._is_due("echo", now_s, ECHO_S):
            self._echo_stamp = time.monotonic_ns()
            self._send(MessageId.ECHO_REQUEST, self._echo_stamp.to_bytes(8, "little"))
        return CHORES_S

    def _is_due(self, chore: str, now_s: float, period_s: float) -> bool:
        if now_s - self._done_s.get(chore, float("-inf")) < period_s:
            return False
        self._done_s[chore] = now_s
        return True

    def _send(self, message_id: MessageId, payload: bytes = b"") -> None:
        if self._command is None:
            return
        try:
            self._command.socket.sendto(write_packet(message_id, payload), self._server)
        except OSError as error:
            self._report(f"cannot send to {self._server[0]}: {error}; is this machine on the server's network?")

    # Packets

    def receive(self, packet: bytes, sender: Address, now_s: float) -> None:
        """Take one packet that `sender` has sent. Belongs to the thread of the socket."""
        source = _source_of(sender)
        if not self._rate_limiter.admits(sender, now_s):
            self._intake.drop("rate", "natnet", "more packets than are read from senders that are not known yet")
            return
        from_server = sender[0] == self._server[0]
        if not (from_server or self._allowed(sender[0])):
            self._rate_limiter.bad(sender)
            self._intake.drop("not_allowed", source, f"the NatNet server is {self._server[0]}")
            return
        try:
            message_id, payload = read_packet(packet)
            if from_server or message_id == MessageId.FRAME:
                self._take(message_id, payload, source, now_s)
        except MessageError as error:
            self._rate_limiter.bad(sender)
            self._intake.drop("malformed", source, error)
            return
        self._rate_limiter.good(sender)
        self._heard_s = now_s

    def _take(self, message_id: int, payload: bytes, source: str, now_s: float) -> None:
        match message_id:
            case MessageId.FRAME:
                self._take_frame(payload, source, now_s)
            case MessageId.SERVER_INFO:
                self._take_server_info(read_server_info(payload), now_s)
            case MessageId.MODEL_DEFINITIONS if self._info is not None:
                self._names.define(read_definitions(payload, self._info.version, self._expected))
                self._report_conflicts()
            case MessageId.ECHO_RESPONSE if self._info is not None:
                stamp, ticks = read_echo(payload)
                if stamp == self._echo_stamp and self._info.clock_hz:
                    self._clock.add(stamp * 1e-9, ticks / self._info.clock_hz, now_s)
            case MessageId.DISCONNECT:
                self._info = None

    def _take_server_info(self, info: ServerInfo, now_s: float) -> None:
        try:
            check_version(info.version)
        except MessageError as error:
            self._info = None
            self._intake.drop("unsupported", "natnet", error)
            self._report(str(error))
            return
        if info != self._info or now_s - self._heard_s > SILENT_S:
            self._clock.clear()
            self._stamps_ahead_s = None
        self._info = info
        self._names.forget()
        self._report(self._listen_to(info))

    def _listen_to(self, info: ServerInfo) -> str | None:
        """Join the server's multicast group if `multicast` asks for it. Returns why no frames will come, or None."""
        if not self._multicast:
            return None if info.multicast_group is None else _STREAMS_MULTICAST
        if self._data is None:
            group, interface = info.multicast_group or MULTICAST_GROUP, self._interface or "0.0.0.0"
            join = functools.partial(join_multicast, group, info.data_port, interface)
            try:
                data = join()
            except ListenError as error:
                return str(error)
            health = ReceiverHealth("natnet-multicast", self._intake.telemetry)
            self._data = UdpThread(data, join, self.receive, lambda now_s: CHORES_S, self._lost, health)
            self._data.start()
        return None

    def _take_frame(self, payload: bytes, source: str, now_s: float) -> None:
        if self._info is None:
            self._intake.drop("unsupported", source, "a frame arrived before the server had sent its version")
            return
        frame = read_frame(payload, self._info.version)
        if frame.exposed_ticks and self._info.clock_hz:
            self._stamps_ahead_s = frame.timestamp_s - frame.exposed_ticks / self._info.clock_hz
        self._names.note(frame)
        self._framed_s = now_s
        self._unused = frame.unused
        self._problem = None
        self._intake.accept(self._body_frame(frame, source, now_s))

    def _body_frame(self, frame: MocapFrame, source: str, now_s: float) -> BodyFrame:
        names = self._names.bodies
        samples = [self._sample(body, body.id, names.get(body.id)) for body in frame.bodies]
        self._refuse_twice(samples)
        if frame.skeletons:
            self._add_bones(samples, frame)
        self._sender_clock.clocks[0].note(frame.timestamp_s, now_s)
        t_s = self._sender_clock.choose((frame.timestamp_s,), now_s, repeats=False)
        timecode = frame.timecode
        rate = None if timecode is None else self._timecode_rate.note(timecode)
        assert t_s is not None  # every frame has a time stamp
        return BodyFrame(t_s, frame.number, tuple(samples), now_s, source, timecode, rate)

    def _add_bones(self, samples: list[BodySample], frame: MocapFrame) -> None:
        bones = list(self._names.bones(frame))
        self._nameless_bones = sum([len(each.bones) for each in frame.skeletons]) - len(bones)
        room = MAX_BODIES - len(samples)
        self._bones_left_out = max(len(bones) - room, 0)
        samples += [self._sample(bone, None, name) for name, bone in bones[:room]]

    def _refuse_twice(self, samples: list[BodySample]) -> None:
        """Two bodies with one streaming id are lost, since nobody can tell which of them is meant."""
        if len({sample.id for sample in samples}) == len(samples):
            self._twice = ()
            return
        counts = Counter(sample.id for sample in samples)
        twice = tuple(id for id, count in counts.items() if count > 1 and id is not None)
        for id in twice:
            lost = BodySample(id, None, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), False, CONFLICT)
            samples[:] = [sample for sample in samples if sample.id != id] + [lost]
        if twice != self._twice:
            self._twice = twice
            self._report_conflicts()

    def _conflicts(self) -> list[str]:
        """Which ids and names are ambiguous, in the definitions or, if these do not tell, in the frames."""
        defined = Counter(id for id, _ in self._names.definitions.bodies)
        unexplained = [
            f"the streaming id {id} occurs twice in each frame, so neither body is used; give each its own id in Motive"
            for id in self._twice
            if defined[id] < 2
        ]
        return [*self._names.conflicts, *unexplained]

    def _report_conflicts(self) -> None:
        for text in self._conflicts():
            if text not in self._reported and len(self._reported) < MOST_REPORTED:
                self._reported.add(text)
                _log.warning("NatNet: %s", text)

    def _sample(self, body: RigidBody, id: int | None, name: str | None) -> BodySample:
        _, x, y, z, qx, qy, qz, qw, _, params = body
        if self._up == "z":  # turn by -90 degrees about x: z becomes y, y becomes -z
            y, z, qy, qz = z, -y, qz, -qy
        return make_sample(id, name, (x, y, z), (qx, qy, qz, qw), params & 1 == 1)

    def _report(self, problem: str | None) -> None:
        """Log a problem once. The problem is assigned in one step, so that it does not flicker in the status."""
        before, self._problem = self._problem, problem
        if problem is not None and problem != before:
            _log.warning("NatNet: %s", problem)

    def _lost(self, count: int) -> None:
        self._intake.drop("kernel", "natnet", "the socket's buffer was full", count)


@functools.lru_cache(maxsize=64)
def _source_of(sender: Address) -> str:
    return f"natnet:{sender[0]}:{sender[1]}"
