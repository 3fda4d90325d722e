"""Statistics of each sender of bodies: its rate, the age of its newest frame, and the offset of its clock.

One-way traffic gives the clock offset only up to the transit time, so the frame with the shortest transit counts. That
transit time is unknown, so the offset has no uncertainty, unlike that of a ping exchange.
"""

import threading
from collections.abc import Sequence
from operator import itemgetter
from typing import Any

from manipnet.inputs.base import Sink
from manipnet.wire.bodies import MAX_BODIES, BodyFrame, BodySample

MOST = 64
MOST_WAITING = 32
"""Frames that are evaluated together, since that costs less than one by one."""
RATE_S = 1.0
"""The period of a rate. Whatever has been silent for as long has a rate of zero, and not the one that it had before."""
CLOCK_S = 10.0
"""The fastest frame of the last one to two of these periods counts, since clocks drift."""
SETTLED_S = 0.25
"""The rate of a sender and of its bodies is counted from this time on after its first frame: what was sent before the
server listened may arrive in one burst."""
RESTART_S = 1.0
"""Transit times vary by less than this. A larger change means that the sender's clock was set or restarted."""

_Key = tuple[int | None, str | None]
"""Id and name of a body."""
_key = itemgetter(BodySample._fields.index("id"), BodySample._fields.index("name"))
_is_tracked = itemgetter(BodySample._fields.index("tracked"))


class SenderStats:
    """Notes every frame and passes it on to `sink`. From any thread."""

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self._lock = threading.Lock()
        self._senders: dict[str, _Sender] = {}
        self._waiting: list[BodyFrame] = []
        """The newest frames, which are not evaluated yet."""

    def __call__(self, frame: BodyFrame) -> None:
        with self._lock:
            self._waiting.append(frame)
            if len(self._waiting) >= MOST_WAITING:
                self._evaluate()
        self._sink(frame)

    def report(self, now_s: float) -> dict[str, dict[str, Any]]:
        """For each source: frames so far, frames per second, age of the newest frame, offset of its clock from ours.

        `clock_speed` is how many seconds of its clock pass in one of ours, or None in its first second. `bodies` are
        its bodies, each with its rate, its age and the share of the frames in which it is tracked.
        """
        with self._lock:
            self._evaluate()
            return {source: sender.report(now_s) for source, sender in self._senders.items()}

    def _evaluate(self) -> None:
        frames_of: dict[str, list[BodyFrame]] = {}
        for frame in self._waiting:
            frames_of.setdefault(frame.source, []).append(frame)
        self._waiting = []
        for source, frames in frames_of.items():
            sender = self._senders.pop(source, None) or _Sender(frames[0])
            if len(self._senders) >= MOST:
                del self._senders[next(iter(self._senders))]  # the sender that has been silent for longest
            self._senders[source] = sender
            sender.note(frames)


class _Sender:
    """What is known about one sender: the current period of its rate and of its clock, and the period before."""

    def __init__(self, first: BodyFrame) -> None:
        self._frames = 0
        self._heard_s = self._since_s = self._clocked_s = first.t_received_s
        self._since_t_s = first.t_s
        self._settles_s: float | None = first.t_received_s + SETTLED_S
        """When its rate begins to be counted, until then."""
        self._counted = 0
        self._rate_hz = 0.0
        self._speed: float | None = None
        self._offset_s = self._offset_before_s = first.t_s - first.t_received_s
        self._bodies: dict[_Key, _Body] = {}

    def note(self, frames: Sequence[BodyFrame]) -> None:
        """Take the next frames, at least one."""
        self._frames += len(frames)
        self._heard_s = frames[-1].t_received_s
        self._note_offsets(frames)
        if self._settles_s is not None:
            settled = [frame for frame in frames if frame.t_received_s >= self._settles_s]
            self._note_bodies(frames[: len(frames) - len(settled)])
            if settled:
                self._settle(settled[0])
            frames = settled
        if frames:
            self._note_rate(len(frames), frames[-1].t_s)
        self._note_bodies(frames)

    def _settle(self, first: BodyFrame) -> None:
        """Begin to count the rate with this frame."""
        self._settles_s = None
        self._since_s, self._since_t_s = first.t_received_s, first.t_s
        self._counted = -1  # the period begins with this frame, so it is not one of those that follow
        for body in self._bodies.values():
            body.restart()

    def report(self, now_s: float) -> dict[str, Any]:
        """One sender in `SenderStats.report`."""
        return {
            "frames": self._frames,
            "rate_hz": self._rate_hz if now_s - self._heard_s <= RATE_S else 0.0,
            "age_s": max(now_s - self._heard_s, 0.0),
            "clock_offset_s": max(self._offset_s, self._offset_before_s),
            "clock_uncertainty_s": None,
            "clock_speed": self._speed,
            "bodies": [body.report(*key, now_s, self._settles_s is None) for key, body in self._bodies.items()],
        }

    def _note_rate(self, count: int, t_s: float) -> None:
        self._counted += count
        passed_s = self._heard_s - self._since_s
        if passed_s >= RATE_S:
            self._rate_hz, self._speed = self._counted / passed_s, (t_s - self._since_t_s) / passed_s
            self._since_s, self._since_t_s, self._counted = self._heard_s, t_s, 0

    def _note_offsets(self, frames: Sequence[BodyFrame]) -> None:
        for frame in frames:
            offset_s = frame.t_s - frame.t_received_s
            if abs(offset_s - self._offset_s) > RESTART_S:  # its clock was set or has restarted
                self._clocked_s = frame.t_received_s
                self._offset_s = self._offset_before_s = offset_s
            elif frame.t_received_s - self._clocked_s >= CLOCK_S:
                self._clocked_s = frame.t_received_s
                self._offset_before_s, self._offset_s = self._offset_s, offset_s
            elif offset_s > self._offset_s:
                self._offset_s = offset_s

    def _note_bodies(self, frames: Sequence[BodyFrame]) -> None:
        """Count the bodies of the frames. Most frames have the same bodies as the one before."""
        if not frames:
            return
        keys: list[_Key] = []
        group: list[BodyFrame] = []
        for frame in frames:
            own = [*map(_key, frame.bodies)]
            if own != keys and group:
                self._count(keys, group)
                group = []
            keys = own
            group.append(frame)
        self._count(keys, group)

    def _count(self, keys: Sequence[_Key], group: Sequence[BodyFrame]) -> None:
        """Count frames that all have the bodies `keys`, in this order."""
        first_s, newest_s = group[0].t_received_s, group[-1].t_received_s
        columns = zip(*[frame.bodies for frame in group], strict=True)
        for key, samples in zip(keys, columns, strict=True):
            body = self._bodies.get(key) or self._add(key, first_s)
            body.count(len(group), sum(map(_is_tracked, samples)), first_s, newest_s)

    def _add(self, key: _Key, now_s: float) -> "_Body":
        if len(self._bodies) >= MAX_BODIES:
            del self._bodies[min(self._bodies, key=lambda each: self._bodies[each].heard_s)]
        self._bodies[key] = _Body(now_s)
        return self._bodies[key]


class _Body:
    """How often one body of a sender arrives, and how often it is tracked, in the current period and the one before."""

    __slots__ = ("_counted", "_rate_hz", "_share", "_since_s", "_tracked", "heard_s")

    def __init__(self, now_s: float) -> None:
        self._since_s = self.heard_s = now_s
        self._counted = self._tracked = 0
        self._rate_hz, self._share = 0.0, 0.0

    def count(self, frames: int, tracked: int, first_s: float, newest_s: float) -> None:
        """Take `frames` that arrived from `first_s` to `newest_s`. The body is tracked in `tracked` of them."""
        if first_s - self._since_s >= RATE_S and self._counted:
            self._rate_hz, self._share = self._counted / (first_s - self._since_s), self._tracked / self._counted
            self._counted = self._tracked = 0
        if not self._counted:
            self._since_s = first_s
        self.heard_s = newest_s
        self._counted += frames
        self._tracked += tracked

    def restart(self) -> None:
        """Begin a period with the next frame. Of what was counted before, only the share that was tracked is kept."""
        self._share = self._tracked / self._counted if self._counted else 0.0
        self._counted = self._tracked = 0

    def report(self, id: int | None, name: str | None, now_s: float, is_settled: bool) -> dict[str, Any]:
        """`id`, `name`, `rate_hz`, `age_s` and the share of the frames in which it was `tracked`."""
        is_young = not self._rate_hz
        age_s = max(now_s - self.heard_s, 0.0)
        rate_hz = self._rate_so_far() if is_young and is_settled else self._rate_hz
        return {
            "id": id,
            "name": name,
            "rate_hz": rate_hz if age_s <= RATE_S else 0.0,
            "age_s": age_s,
            "tracked": self._tracked / self._counted if self._counted and is_young else self._share,
        }

    def _rate_so_far(self) -> float:
        passed_s = self.heard_s - self._since_s
        return (self._counted - 1) / passed_s if passed_s > 0.0 else 0.0
