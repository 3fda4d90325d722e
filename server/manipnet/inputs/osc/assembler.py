"""Assembles the OSC messages of one sender into frames, each of which holds the messages of one instant."""

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from manipnet.inputs.osc.addresses import AddressBook
from manipnet.inputs.osc.memory import REFUSED, BodyMemory, Fields
from manipnet.inputs.osc.packet import IMMEDIATELY, Packet, time_tag_to_s
from manipnet.inputs.osc.reader import BodyKey, Content
from manipnet.inputs.sender_clock import ARRIVAL, SenderClock
from manipnet.inputs.timecode_rate import TimecodeRate
from manipnet.wire.bodies import MAX_BODIES, BodyFrame, BodySample, MessageError
from manipnet.wire.timecode import timecode_text

GAP_S: Final = 0.005
"""Unmarked messages that arrive farther apart than this belong to different frames."""
MARKED_GAP_S: Final = 0.050
"""Timeout for a frame that was started but not ended."""
CLOCK_PATIENCE: Final = 15
"""After this many frames without a time stamp, a sender counts as one that sends none."""
VMC_TIME_S: Final = 0.1
"""How long a time of `/VMC/Ext/T` stands for frames that come without one."""
CLOCKS: Final = ("time tag", "/frame/timestamp", "/VMC/Ext/T")
"""The clocks of a sender, best first."""
_POSES: Final = frozenset(("position", "quat", "transformation", "local"))
_OF_BODY: Final = _POSES | {"tracked", "parts"}


@dataclass(slots=True)
class _Pending:
    """The frame that is being assembled: the fields of each body, and its times."""

    bodies: dict[BodyKey, Fields] = field(default_factory=dict)
    number: int | None = None
    stamp_s: float | None = None
    vmc_s: float | None = None
    time_tag: int = IMMEDIATELY
    timecode: str | None = None
    marked: bool = False
    begun_s: float | None = None
    touched_s: float = 0.0


@dataclass(slots=True)
class _VmcTime:
    """The newest time of `/VMC/Ext/T`, which may come in a datagram of its own, and the bodies that had this time."""

    t_s: float | None = None
    noted_s: float = 0.0
    bodies: set[BodyKey] = field(default_factory=set)


class Added(NamedTuple):
    """What a datagram gave: the frames that it completes, whether it holds anything of use, and what was wrong."""

    frames: list[BodyFrame]
    useful: bool
    faults: list[str]


class FrameAssembler:
    """Assembles the messages of one sender into frames. Reads no clock: arrival times are arguments.

    A frame ends with `/frame/end`, at the end of its bundle, with a second value for a field that it already has, or
    after a gap. Between `/frame/start` and `/frame/end` it may extend over several datagrams and bundles. Its time is
    that of the first clock in `CLOCKS` that runs, or else its arrival. A frame that lacks the clock in use is dropped
    and counted in `incomplete`, since its arrival time would not fit between the others.
    """

    def __init__(self, source: str, book: AddressBook | None = None) -> None:
        self.source = source
        self.incomplete = 0
        self.heard_s = float("-inf")
        """When the newest message of use arrived."""
        self.clock = SenderClock(CLOCKS)
        self._book = book or AddressBook()
        self.memory = BodyMemory(self._book.bodies)
        self._pending = _Pending()
        self._vmc = _VmcTime()
        self._without_clock = 0
        self._bodies: tuple[BodySample, ...] = ()
        self._timecode_rate = TimecodeRate()

    @property
    def pending(self) -> bool:
        """Whether a frame is being assembled."""
        return bool(self._pending.bodies)

    def add(self, packet: Packet, t_received_s: float) -> Added:
        """Take one datagram as `split_packet` returned it. A message that is wrong costs only itself."""
        messages, faults = packet
        contents: list[tuple[int, Content]] = []
        for tag, message in messages:
            try:
                content = self._book.read(message, self.source, t_received_s)
            except MessageError as error:
                faults.append(str(error))
            else:
                if content is not None:
                    contents.append((tag, content))
        frames = self.flush(t_received_s)
        if contents:
            self.heard_s = t_received_s
        for time_tag, content in contents:
            if self._begins_next_frame(content, time_tag, contents):
                self._close(frames)
            self._take(content, time_tag, t_received_s, frames)
        # Some senders wrap each message in a bundle of its own, so only a bundle of several messages ends a frame.
        if len(contents) > 1 and not self._pending.marked:
            self._close(frames)
        return Added(frames, bool(contents), faults)

    def flush(self, now_s: float) -> list[BodyFrame]:
        """The frame that is complete because nothing has arrived for a while, if there is one."""
        frames: list[BodyFrame] = []
        pending = self._pending
        if pending.bodies and now_s - pending.touched_s > (MARKED_GAP_S if pending.marked else GAP_S):
            self._close(frames)
        return frames

    def _take(self, content: Content, time_tag: int, now_s: float, frames: list[BodyFrame]) -> None:
        route = content.route
        pending = self._pending
        pending.touched_s = now_s
        if pending.begun_s is None:
            pending.begun_s = now_s
        if pending.time_tag != time_tag > IMMEDIATELY:
            pending.time_tag = time_tag
            self._note_tag(time_tag, now_s)
        if route.field in _OF_BODY:
            self._take_body(content)
            return
        match route.field:
            case "start":
                pending.number, pending.marked = int(content.values[0]), True
            case "end":
                pending.number = int(content.values[0])
                self._close(frames)
            case "ms" | "s" | "smpte":
                self._note_time(route.field, content.values[0], now_s)
            case "name":
                self.memory.name(route.body, route.text)
            case "skeleton":
                self._book.name_skeleton(route.body, route.text)

    def _take_body(self, content: Content) -> None:
        bodies = self._pending.bodies
        fields = bodies.get(content.route.body)
        if fields is None:
            if len(bodies) >= MAX_BODIES:
                self.incomplete += 1
                return
            fields = bodies[content.route.body] = {}
        elif content.route.field in _POSES and fields.get(content.route.field, content.values) != content.values:
            # A datagram that arrives twice repeats its values; another value is that of another body.
            fields[REFUSED] = True
        add_to(fields, content)

    def _note_tag(self, time_tag: int, now_s: float) -> None:
        clock = self.clock.clocks[0]
        # Whole seconds, and times of the first hour of 1900, are rather numbers that only look like a time tag.
        clock.doubtful = clock.runs is None and (time_tag & 0xFFFFFFFF == 0 or time_tag >> 32 == 0)
        clock.note(time_tag_to_s(time_tag), now_s)

    def _note_time(self, field: str, value: float, now_s: float) -> None:
        pending = self._pending
        if field == "ms":
            pending.stamp_s = value / 1_000.0
            self.clock.clocks[1].note(pending.stamp_s, now_s)
        elif field == "s":
            pending.vmc_s = value
            self._vmc = _VmcTime(value, now_s)
            self.clock.clocks[2].note(value, now_s)
        else:
            pending.timecode = timecode_text(int(value))

    def _begins_next_frame(self, content: Content, time_tag: int, contents: list[tuple[int, Content]]) -> bool:
        """Whether a message, of those in a datagram, cannot belong to the frame that is being assembled."""
        pending, route = self._pending, content.route
        if route.field == "start":  # a datagram that arrives twice repeats the start of the open frame
            return not (pending.marked and pending.number == int(content.values[0]))
        if pending.marked:
            return False
        if pending.bodies and IMMEDIATELY not in (time_tag, pending.time_tag) and time_tag != pending.time_tag:
            return True
        if route.field == "ms":
            return pending.stamp_s is not None
        if route.field == "s":
            return pending.vmc_s is not None
        fields = pending.bodies.get(route.body)
        if fields is None or (route.field not in fields and fields.keys().isdisjoint(route.parts)):
            return False
        return REFUSED not in fields and route.body not in _same_keys(contents)

    def _close(self, frames: list[BodyFrame]) -> None:
        pending, self._pending = self._pending, _Pending()
        if not pending.bodies:
            if not pending.marked:  # a time without bodies is that of the bodies in the next datagram
                self._pending.stamp_s = pending.stamp_s
            return
        bodies = self.memory.samples(pending.bodies, pending.touched_s)
        if not bodies:
            return
        t_s = self._time(pending, bodies)
        if t_s is None:
            self.incomplete += 1
        else:
            timecode = pending.timecode
            rate = None if timecode is None else self._timecode_rate.note(timecode)
            frames.append(BodyFrame(t_s, pending.number, bodies, pending.touched_s, self.source, timecode, rate))

    def _time(self, pending: _Pending, bodies: tuple[BodySample, ...]) -> float | None:
        tag_s = None if pending.time_tag <= IMMEDIATELY else time_tag_to_s(pending.time_tag)
        vmc_s = self._vmc_s(pending)
        arrived_s = pending.touched_s if pending.begun_s is None else pending.begun_s
        repeats, self._bodies = self.clock.used == ARRIVAL and bodies == self._bodies, bodies
        t_s = self.clock.choose((tag_s, pending.stamp_s, vmc_s), arrived_s, repeats)
        if t_s is not None:
            self._without_clock = 0
        else:
            self._without_clock += 1
            if self._without_clock > CLOCK_PATIENCE:
                self.clock.forget()
                t_s = self.clock.choose((tag_s, pending.stamp_s, vmc_s), arrived_s, repeats)
        return t_s

    def _vmc_s(self, pending: _Pending) -> float | None:
        """The time of `/VMC/Ext/T` from an earlier datagram. It stands still if a body comes a second time with it."""
        vmc = self._vmc
        if vmc.t_s is None or pending.touched_s - vmc.noted_s > VMC_TIME_S:
            return None
        if not vmc.bodies.isdisjoint(pending.bodies):
            self.clock.clocks[2].note(vmc.t_s, pending.touched_s)
        vmc.bodies.update(pending.bodies)
        return vmc.t_s


def add_to(fields: Fields, content: Content) -> None:
    """Add what a message says about a body to the fields of that body."""
    route, values, tracked = content
    if route.parts:
        fields.update({part: (value,) for part, value in zip(route.parts, values, strict=True)})
        fields["converter"] = route.converter
    else:
        fields[route.field] = values
    if tracked is not None:
        fields["tracked"] = (tracked,)


def _same_keys(contents: list[tuple[int, Content]]) -> Collection[BodyKey]:
    """The bodies that occur in one datagram with two different poses, while others occur once: they share a key.

    If every body occurs as often as the others, the datagram holds several frames.
    """
    poses = [(route.body, route.field, values) for _, (route, values, _) in contents if route.field in _POSES]
    counts = Counter((body, field) for body, field, _ in poses)
    if len(contents) < 3 or len(counts) == len(poses) or min(counts.values()) > 1:
        return frozenset()
    return {body for (body, _), count in Counter((body, field) for body, field, _ in {*poses}).items() if count > 1}
