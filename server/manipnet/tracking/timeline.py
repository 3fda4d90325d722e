"""Stream time: frames at any rate in, ticks at exactly 60 per second of the sender's time out.

The tick `k` of a run shows the instant `t0 + k/60`, where `t0` is the run's first frame. It is synthesised from the
window about that instant, so it falls due once samples up to it plus the look-ahead have arrived. In a silence our own
clock carries stream time on, so ticks never stop. The clock is always an argument; nothing here waits, sends or reads
the time.
"""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Final

import numpy as np

from manipnet.geometry import Array, compose
from manipnet.synthesis.model.layout import PRESENT, WINDOW_OFFSETS_S
from manipnet.synthesis.model.providers import MAX_LOOK_AHEAD_S
from manipnet.tracking.forecast import damped_velocity
from manipnet.tracking.pose_buffer import TIME_TOLERANCE_S, Forecast, PoseBuffer, sample

TICK_HZ: Final = 60
TICK_S: Final = 1.0 / TICK_HZ

SILENCE_S: Final = 0.06
"""Without a frame for this long (or three usual intervals, if longer) our clock carries stream time on."""
MAX_BACKLOG: Final = 120
"""Ticks due at once beyond which all but the newest are skipped."""
SLEW: Final = 0.25
"""A changed look-ahead is reached by making ticks this much faster or slower, so none is missing."""
VANISHED_S: Final = 0.1
"""Ticks never wait longer than this for one body while others are being sent."""
RESTART_S: Final = 0.5
"""A frame this far behind the stream, or `AHEAD_S` ahead of it, may be a sender that started again."""
AHEAD_S: Final = 0.5
LATE_S: Final = 10.0
"""A frame up to this far behind was long under way; beyond, it is of another clock."""
CATCH_UP_S: Final = 0.25
"""A sender that was late, not standing still, has this long to deliver what it kept back."""
CLOCK_JUMP_CONFIRMATIONS: Final = 3
"""Frames in a row that must agree on a new time before it is believed: one bad stamp must not move the
clock.
"""
OTHER_SENDER_S: Final = 0.2
"""A body, and the clock, may pass to another sender once the one that had it was silent this long."""

Pose = Array | Sequence[float]
Poses = Mapping[str, Pose | None]
"""One frame's bodies of interest; None is one that is not tracked."""


_CLOCK: Final = ""
"""Key of the sender whose time is the stream's, among those of the bodies."""


@dataclass(frozen=True, slots=True)
class BodyAtTick:
    """One body as one tick sees it: `window (21, 7)` around it, `pose (7,)` at it, world frame.

    `age_s` is the time from its newest tracked sample to the tick. The pose is `known` when it lies between samples,
    not beyond the newest.
    """

    window: Array
    pose: Array
    age_s: float
    known: bool = True


@dataclass(frozen=True, slots=True)
class BodyHealth:
    """How a body arrives: the rate of its tracked samples, and the age of the newest one by the stream's clock."""

    rate_hz: float
    age_s: float


@dataclass(frozen=True, slots=True)
class Tick:
    """One instant to show. `bodies` holds those tracked at least once in this run; `run` counts sender
    restarts.
    """

    run: int
    index: int
    time_s: float
    look_ahead_s: float
    waited_for_s: float
    """Our clock when what the tick needed had arrived, or when our clock let it fall due."""
    silent: bool
    bodies: Mapping[str, BodyAtTick]


class Run:
    """The frames of one run of a sender's clock, and the ticks counted from its first frame."""

    def __init__(self, number: int, t0_s: float, now_s: float) -> None:
        self.number, self.t0_s = number, t0_s
        self.tracks: dict[str, PoseBuffer] = {}
        self.next_index = 0
        self.newest_s, self.heard_s = t0_s, now_s
        self.carried_s: float | None = None
        """When our clock, not a frame, let the newest tick go."""
        self._gaps_s = deque[float](maxlen=32)
        self._arrivals = deque[tuple[float, float]](maxlen=1024)

    def add(self, t_s: float, poses: Poses, now_s: float) -> int:
        """Take a frame; a pose of None is a body that is not tracked. Returns how many poses were
        duplicates.
        """
        if t_s > self.newest_s:
            self._gaps_s.append(now_s - self.heard_s)
            self.newest_s, self.heard_s = t_s, now_s
            self._arrivals.append((t_s, now_s))
        doubled = 0
        for key, pose in poses.items():
            track = self.tracks.get(key)
            if track is None:  # making one to throw it away would cost more than all the rest
                track = self.tracks[key] = PoseBuffer()
            track.seen_s = max(track.seen_s, t_s)
            doubled += pose is not None and not track.add(t_s, pose)
        return doubled

    def silence_s(self) -> float:
        """How long without a frame counts as silence."""
        return max(SILENCE_S, 3.0 * median(self._gaps_s)) if self._gaps_s else SILENCE_S

    def arrived_s(self) -> float:
        """Stream time up to which every body that is still being sent has arrived."""
        reached = self.newest_s
        for track in self.tracks.values():
            lag = self.newest_s - track.seen_s
            if 0.0 < lag <= min(2.5 * track.interval_s(), VANISHED_S):
                reached = min(reached, track.seen_s)
        return reached

    def completed_s(self, due_s: float) -> float:
        """Our clock when the stream reached `due_s`, by a frame or in a silence. Ask with rising times."""
        while self._arrivals and self._arrivals[0][0] < due_s - TIME_TOLERANCE_S:
            self._arrivals.popleft()
        return self._arrivals[0][1] if self._arrivals else self.heard_s + due_s - self.newest_s

    def clock_s(self, now_s: float) -> float:
        """Stream time if the sender's clock went on since its newest frame."""
        return self.newest_s + (now_s - self.heard_s)

    def index_at(self, t_s: float) -> int:
        """The first tick at or after an instant."""
        return math.ceil((t_s - self.t0_s) * TICK_HZ - TIME_TOLERANCE_S)

    def tick_s(self, index: int) -> float:
        """The instant of a tick."""
        return self.t0_s + index / TICK_HZ


class Timeline:
    """From the frames of one actor to its ticks, through lost, late and restarted senders."""

    def __init__(self, look_ahead_s: float = MAX_LOOK_AHEAD_S, forecast: Forecast = damped_velocity) -> None:
        self.look_ahead_s = look_ahead_s
        """What is asked for; may be set at any time within 0 … `MAX_LOOK_AHEAD_S`."""
        self.skipped_late = self.skipped_at_restart = 0
        """Ticks not shown: they fell due all at once, or a new run began before the old one had played out."""
        self.restarts = 0
        """How often the sender's time began anew."""
        self._forecast = forecast
        self._effective_s = look_ahead_s
        self._run: Run | None = None
        self._ending: Run | None = None
        self._resumed: tuple[int, float] | None = None
        self._senders: dict[str, tuple[str, float]] = {}
        self._jump_frames: list[tuple[float, Poses, float]] = []

    @property
    def running(self) -> bool:
        """Whether a frame has come yet."""
        return self._run is not None

    def push(self, t_s: float, poses: Poses, now_s: float, source: str = "") -> str | None:
        """Take one frame of this actor's bodies; returns why it was dropped, or None.

        Reasons are of `telemetry.DROP_REASONS`: other_sender, late, time_jump, duplicate. Several senders may share
        an actor if they share a clock and no body.
        """
        poses = {key: pose for key, pose in poses.items() if self._may_send(key, source, now_s)}
        if not poses:
            return "other_sender"
        run = self._run or self._begin(t_s, now_s)
        silent_for = now_s - run.heard_s
        if not -RESTART_S < t_s - run.newest_s < AHEAD_S + 1.5 * silent_for:
            return self._doubt(run, t_s, poses, now_s, source)
        for key in (_CLOCK, *poses):
            if self._may_send(key, source, now_s):
                self._senders[key] = (source, now_s)
        self._jump_frames.clear()
        if silent_for > run.silence_s() and self._is_ahead_of(run, t_s):
            self._resumed = (run.index_at(t_s), now_s)
        doubled = run.add(t_s, poses, now_s)
        return "duplicate" if doubled and doubled == len(poses) else None

    def poll(self, now_s: float) -> Tick | None:
        """The next tick that is due, if any. Call again until None: one frame may make several due."""
        run = self._run
        if run is None:
            return None
        if self._ending is not None:
            if self._due_s(run, run.next_index) > self._reached_s(run, now_s):
                return self._take(self._ending, self._ending.clock_s(now_s), now_s)
            self.skipped_at_restart += max(
                int((self._ending.newest_s - self._ending.tick_s(self._ending.next_index)) * TICK_HZ), 0
            )
            self._ending = None
        self._rewind(run, now_s)
        return self._take(run, self._reached_s(run, now_s), now_s)

    def next_poll_s(self, now_s: float) -> float:
        """When, on our clock, the next tick falls due if no frame comes before; infinite before the first
        frame.
        """
        if self._run is None:
            return np.inf
        run = self._ending or self._run
        quiet_until = run.heard_s + (0.0 if self._ending else run.silence_s())
        by_clock = max(quiet_until, run.heard_s + self._due_s(run, run.next_index) - run.newest_s)
        return max(min(by_clock, self._patience_s(run)), now_s)

    def health(self, now_s: float) -> dict[str, BodyHealth]:
        """Of every body heard of in this run."""
        if self._run is None:
            return {}
        clock = self._run.clock_s(now_s)
        tracks = self._run.tracks.items()
        return {key: BodyHealth(1.0 / track.interval_s(), track.age_s(clock)) for key, track in tracks}

    def recent(self, key: str, seconds: float) -> Array:
        """Tracked poses `(n, 7)` of a body in the newest `seconds` of the stream, rising in time."""
        track = None if self._run is None else self._run.tracks.get(key)
        if self._run is None or track is None:
            return np.empty((0, 7))
        return track.poses[track.times >= self._run.newest_s - seconds].copy()

    def move(self, key: str, T_old_new: Array) -> None:
        """What sits on a body sits elsewhere on it from now on: move what was heard of it along, so nothing jumps
        between past and future."""
        for run in (self._run, self._ending):
            if run is not None and key in run.tracks:
                poses = run.tracks[key].poses
                poses[:] = compose(poses, T_old_new)

    def _due_s(self, run: Run, index: int) -> float:
        """Stream time that must have arrived for a tick."""
        return run.tick_s(index) + self._effective_s

    def _reached_s(self, run: Run, now_s: float) -> float:
        now_s += TIME_TOLERANCE_S  # a poll at just the time asked for must not come too early by a rounding
        if now_s - run.heard_s >= run.silence_s():
            return run.clock_s(now_s)
        if now_s >= self._patience_s(run):
            return max(run.arrived_s(), self._due_s(run, run.next_index))
        return run.arrived_s()

    def _is_ahead_of(self, run: Run, t_s: float) -> bool:
        """Whether our clock has carried the ticks far beyond what a sender says is now."""
        return self._due_s(run, run.next_index) - t_s > RESTART_S

    def _rewind(self, run: Run, now_s: float) -> None:
        """Show again from where a sender went on that had stood still, unless it only was late and catches up."""
        if self._resumed is None:
            return
        index, since_s = self._resumed
        if not self._is_ahead_of(run, run.arrived_s()):
            self._resumed = None
        elif now_s - since_s >= CATCH_UP_S and run.arrived_s() >= self._due_s(run, index):
            self._resumed, run.carried_s = None, None
            run.next_index, run.number = index, run.number + 1
            self.restarts += 1

    def _patience_s(self, run: Run) -> float:
        """When a tick goes without its frames because our clock had run ahead of a sender that came back.

        Ticks then come a little slower, until the sender has caught up, instead of stopping.
        """
        return np.inf if run.carried_s is None else run.carried_s + TICK_S * (1.0 + SLEW)

    def _take(self, run: Run, reached_s: float, now_s: float) -> Tick | None:
        limit = reached_s + TIME_TOLERANCE_S
        if self._due_s(run, run.next_index) > limit:
            return None
        backlog = int((limit - self._due_s(run, run.next_index)) * TICK_HZ)
        if backlog >= MAX_BACKLOG:
            self.skipped_late += backlog
            run.next_index += backlog
        run.carried_s = now_s if self._due_s(run, run.next_index) > run.newest_s + TIME_TOLERANCE_S else None
        tick = self._tick(run, run.next_index, now_s)
        run.next_index += 1
        self._slew()
        return tick

    def _tick(self, run: Run, index: int, now_s: float) -> Tick:
        time_s, due_s = run.tick_s(index), self._due_s(run, index)
        silent = due_s > run.newest_s + TIME_TOLERANCE_S
        tracks = {key: track for key, track in run.tracks.items() if len(track.times)}
        bodies: dict[str, BodyAtTick] = {}
        if tracks:
            instants = time_s + WINDOW_OFFSETS_S
            # The future of a sender that has stopped is not forecast: its last pose stands.
            forecast = None if silent else self._forecast
            poses, ages = sample(list(tracks.values()), instants, time_s, due_s, forecast)
            bodies = {
                key: BodyAtTick(rows, rows[PRESENT], age_s, bool(time_s <= track.times[-1] + TIME_TOLERANCE_S))
                for (key, track), rows, age_s in zip(tracks.items(), poses, ages, strict=True)
            }
        waited_for_s = min(run.completed_s(due_s), now_s)
        return Tick(run.number, index, time_s, self._effective_s, waited_for_s, silent, bodies)

    def _slew(self) -> None:
        step = SLEW * TICK_S
        self._effective_s += min(max(self.look_ahead_s - self._effective_s, -step), step)

    def _begin(self, t_s: float, now_s: float) -> Run:
        """Start a run; the one before plays out by our clock until the new one's first tick is due."""
        number = 0
        if self._run is not None:
            self.restarts += 1
            number = self._run.number + 1
            self._ending = self._ending or self._run
        else:
            self._effective_s = self.look_ahead_s
        self._jump_frames.clear()
        self._resumed = None
        self._run = Run(number, t_s, now_s)
        return self._run

    def _may_send(self, key: str, source: str, now_s: float) -> bool:
        """Whether `source` has, or may take over, a body or the clock."""
        owner, heard_s = self._senders.get(key, (source, now_s))
        return owner == source or now_s - heard_s >= OTHER_SENDER_S

    def _doubt(self, run: Run, t_s: float, poses: Poses, now_s: float, source: str) -> str | None:
        """Hold back a frame of an unlikely time until enough others agree with it."""
        if not self._may_send(_CLOCK, source, now_s):
            return "other_sender"
        if self._jump_frames and not 0.0 < t_s - self._jump_frames[-1][0] < AHEAD_S:
            self._jump_frames.clear()
        self._jump_frames.append((t_s, poses, now_s))
        if len(self._jump_frames) < CLOCK_JUMP_CONFIRMATIONS:
            return "late" if 0.0 < run.newest_s - t_s < LATE_S else "time_jump"
        jump_frames = list(self._jump_frames)
        self._senders = dict.fromkeys((_CLOCK, *poses), (source, now_s))
        begun = self._begin(jump_frames[0][0], jump_frames[0][2])
        for jump_frame in jump_frames:
            begun.add(*jump_frame)
        return None
