"""Assembles the OSC messages of one sender into frames, each of which holds the messages of one instant."""

from dataclasses import dataclass, field

from manipnet.inputs.osc.addresses import BodyKey, Numbers, Route, read_route
from manipnet.inputs.osc.packet import IMMEDIATELY, time_tag_to_s
from manipnet.wire.bodies import MAX_BODIES, BodyFrame, BodySample, make_sample

GAP_S = 0.005
"""Unmarked messages that arrive farther apart than this belong to different frames."""
MARKED_GAP_S = 0.050
"""Timeout for a frame that was started but not ended."""
CLOCK_PATIENCE = 60
"""After this many frames without a time stamp, a sender counts as one that sends none."""

_ARRIVAL, _STAMP, _TAG = range(3)


@dataclass(slots=True)
class _Pending:
    """The frame that is being assembled: the fields of each body, and its times."""

    bodies: dict[BodyKey, dict[str, Numbers]] = field(default_factory=dict)
    number: int | None = None
    stamp_s: float | None = None
    time_tag: int = IMMEDIATELY
    marked: bool = False
    begun_s: float | None = None
    touched_s: float = 0.0


class FrameAssembler:
    """Assembles the messages of one sender into frames. Reads no clock: arrival times are arguments.

    A frame ends with `/frame/end`, at the end of its bundle, with a second value for a field that it already has, or
    after a gap. Between `/frame/start` and `/frame/end` it may extend over several datagrams and bundles. Its time is
    the time tag of its bundle, or else `/frame/timestamp`, or else its arrival. Once a sender has given times, a frame
    without one is dropped and counted in `incomplete`, since its arrival time would not fit between the others.
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self.incomplete = 0
        self._pending = _Pending()
        self._clock = _ARRIVAL
        self._without_clock = 0

    @property
    def pending(self) -> bool:
        """Whether a frame is being assembled."""
        return bool(self._pending.bodies)

    def add(self, messages: list[tuple[int, bytes]], t_received_s: float) -> tuple[list[BodyFrame], bool]:
        """The frames that one datagram completes, and whether any of its messages has a known address.

        `messages` is what `split_packet` returned. Raises `MessageError` for a wrong message, and then ignores the
        whole datagram.
        """
        routes = [(tag, route) for tag, message in messages if (route := read_route(message)) is not None]
        frames = self.flush(t_received_s)
        for time_tag, route in routes:
            self._take(route, time_tag, t_received_s, frames)
        # Some senders wrap each message in a bundle of its own, so only a bundle of several messages ends a frame.
        if len(routes) > 1 and not self._pending.marked:
            self._close(frames)
        return frames, bool(routes)

    def flush(self, now_s: float) -> list[BodyFrame]:
        """The frame that is complete because nothing has arrived for a while, if there is one."""
        frames: list[BodyFrame] = []
        patience_s = MARKED_GAP_S if self._pending.marked else GAP_S
        if self.pending and now_s - self._pending.touched_s > patience_s:
            self._close(frames)
        return frames

    def _take(self, route: Route, time_tag: int, t_received_s: float, frames: list[BodyFrame]) -> None:
        if self._begins_next_frame(route, time_tag):
            self._close(frames)
        pending = self._pending
        pending.touched_s = t_received_s
        pending.begun_s = t_received_s if pending.begun_s is None else pending.begun_s
        if time_tag != IMMEDIATELY:
            pending.time_tag = time_tag
        match route.field:
            case "start":
                pending.number, pending.marked = int(route.values[0]), True
            case "end":
                pending.number = int(route.values[0])
                self._close(frames)
            case "timestamp":
                pending.stamp_s = route.values[0] / 1_000.0
            case _ if route.body in pending.bodies or len(pending.bodies) < MAX_BODIES:
                pending.bodies.setdefault(route.body, {})[route.field] = route.values
            case _:
                self.incomplete += 1

    def _begins_next_frame(self, route: Route, time_tag: int) -> bool:
        """Whether a message cannot belong to the frame that is being assembled."""
        pending = self._pending
        if route.field == "start":  # a datagram that arrives twice repeats the start of the open frame
            return not (pending.marked and pending.number == int(route.values[0]))
        if pending.marked:
            return False
        if pending.bodies and IMMEDIATELY not in (time_tag, pending.time_tag) and time_tag != pending.time_tag:
            return True
        if route.field == "timestamp":
            return pending.stamp_s is not None
        return route.field in pending.bodies.get(route.body, ())

    def _close(self, frames: list[BodyFrame]) -> None:
        pending, self._pending = self._pending, _Pending()
        samples = [_sample(key, fields) for key, fields in pending.bodies.items()]
        bodies = tuple(sample for sample in samples if sample is not None)
        if not bodies:
            return
        t_s = self._time(pending)
        if t_s is None:
            self.incomplete += 1
        else:
            frames.append(BodyFrame(t_s, pending.number, bodies, pending.touched_s, self.source))

    def _time(self, pending: _Pending) -> float | None:
        times = {_ARRIVAL: pending.begun_s if pending.begun_s is not None else pending.touched_s}
        if pending.stamp_s is not None:
            times[_STAMP] = pending.stamp_s
        if pending.time_tag != IMMEDIATELY:
            times[_TAG] = time_tag_to_s(pending.time_tag)
        best = max(times)
        self._without_clock = self._without_clock + 1 if best < self._clock else 0
        if best > self._clock or self._without_clock > CLOCK_PATIENCE:
            self._clock, self._without_clock = best, 0
        return times.get(self._clock)


def _sample(key: BodyKey, fields: dict[str, Numbers]) -> BodySample | None:
    """The body with the given fields, or None if a part of its pose is missing."""
    id, name = (key, None) if isinstance(key, int) else (None, key)
    tracked = fields.get("tracked", (1.0,))[0] != 0.0
    pose = fields.get("local") or fields.get("transformation")  # of the two in VMC, "local" is not scaled
    if pose is None and "position" in fields and "quat" in fields:
        pose = fields["position"] + fields["quat"]
    if pose is None:
        return None if tracked else make_sample(id, name, (0.0,) * 3, (0.0,) * 4, False)
    return make_sample(id, name, pose[:3], pose[3:], tracked)
