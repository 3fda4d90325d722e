"""Stream time: frames at any rate come in, and ticks at exactly 60 per second of the sender's time go out.

Tick `k` of a run shows the instant `t0 + k/60`, where `t0` is the time of the run's first frame, or of one soon after
it (`actors.spread`). It is synthesised from the window around that instant, so it falls due once samples up to it plus
the look-ahead have arrived. In a silence our own clock carries stream time on, so ticks never stop. Our clock is always
an argument; nothing here waits, sends or reads the time.

    EMPTY
      │ first frame
      ▼            no frame for silence_s
    FOLLOWING ────────────────────────────────► SILENT
     ▲ ▲  │ ▲ ▲                                  │  │
     │ │  │ │ └──────────────────────────────────┘  │
     │ │  │ │        a frame arrives                │ a frame arrives more than RESTART_S
     │ │  │ │                                       │ behind the ticks
     │ │  │ │                                       ▼
     │ │  │ └──────────────────────────────────── RESUMED
     │ │  │     the sender catches up, or CATCH_UP_S passes: rewind to where it resumed
     │ │  │
     │ │  │ a frame is RESTART_S behind or AHEAD_S ahead of stream time
     │ │  ▼
     │ └ DOUBTING
     │    │     a likely frame arrives: the held frames are dropped
     │    │
     │    │ CLOCK_JUMP_CONFIRMATIONS held frames in a row agree: a new run begins
     │    ▼
     └── ENDING
              the first tick of the new run is due

    state      kept in             the next tick falls due
    FOLLOWING  `_run`              when its look-ahead has arrived
    SILENT     `_run.arrivals`     by our clock
    DOUBTING   `_jumps`            as before: held frames change nothing, and DOUBTING begins in a silence as well
    ENDING     `_ending`           by our clock, in the run before
    RESUMED    `_rewind`           a little slower than in real time, until the sender has caught up

Several senders may share an actor; `SenderHandover` decides which of them moves a body.
"""

from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.synthesis.model.providers import MAX_LOOK_AHEAD_S
from manipnet.tracking.clock_jumps import ClockJumps, HeldFrame, drop_reason
from manipnet.tracking.forecast import damped_velocity
from manipnet.tracking.pose_buffer import TIME_TOLERANCE_S, Forecast
from manipnet.tracking.rewind import Rewind
from manipnet.tracking.run import Run
from manipnet.tracking.schedule import Schedule
from manipnet.tracking.sender_handover import CLOCK, SenderHandover
from manipnet.tracking.smoothing import Smoother
from manipnet.tracking.tick import TICK_HZ, BodyHealth, Poses, Tick, bodies_at

MAX_BACKLOG: Final = 120
"""If more ticks than this are due at once, all but the newest of them are skipped."""


class Timeline:
    """Turns the frames of one actor into its ticks, however its senders behave."""

    def __init__(
        self,
        look_ahead_s: float = MAX_LOOK_AHEAD_S,
        forecast: Forecast = damped_velocity,
        start_delay_s: float = 0.0,
    ) -> None:
        """The first tick of each run is at the first frame `start_delay_s` after the run's first one, or later."""
        self.skipped_late = self.skipped_at_restart = 0
        """Ticks that were not shown: too many fell due at once, or a new run began before the old one played out."""
        self.restarts = 0
        """How often the sender's clock restarted."""
        self._forecast, self._start_delay_s = forecast, start_delay_s
        self._run: Run | None = None
        self._ending: Run | None = None
        self._schedule = Schedule(look_ahead_s)
        self._rewind = Rewind(self._schedule)
        self._senders, self._jumps = SenderHandover(), ClockJumps()
        self._smoother = Smoother()

    @property
    def look_ahead_s(self) -> float:
        """The requested look-ahead, 0 … `MAX_LOOK_AHEAD_S`; it may be set at any time."""
        return self._schedule.look_ahead_s

    @look_ahead_s.setter
    def look_ahead_s(self, seconds: float) -> None:
        self._schedule.look_ahead_s = seconds

    @property
    def running(self) -> bool:
        """Whether a frame has arrived."""
        return self._run is not None

    def push(self, t_s: float, poses: Poses, now_s: float, source: str = "") -> str | None:
        """Take one frame of this actor's bodies; returns why it was dropped, or None.

        The reasons are of `telemetry.DROP_REASONS`: other_sender, late, time_jump, duplicate.
        """
        if refused := self._senders.refused(poses, source, now_s):
            poses = {name: pose for name, pose in poses.items() if name not in refused}
        if not poses:
            return "other_sender"
        run = self._run or self._begin(t_s, now_s)
        if not self._jumps.is_likely(run.arrivals, t_s, now_s):
            return self._doubt(run, HeldFrame(t_s, poses, now_s), source)
        self._senders.note(poses, source, now_s)
        self._jumps.forget()
        self._rewind.note(run, t_s, now_s)
        duplicates = run.add(t_s, poses, now_s)
        return "duplicate" if duplicates and duplicates == len(poses) else None

    def poll(self, now_s: float) -> Tick | None:
        """The next tick that is due, if any. One frame may let several fall due, so call again until None."""
        run, ending = self._run, self._ending
        if run is None:
            return None
        reached_s = self._schedule.reached_s(run, now_s)
        if ending is not None:
            if self._schedule.due_s(run, run.next_index) > reached_s:
                return self._take(ending, ending.arrivals.clock_s(now_s), now_s)
            left_s = ending.arrivals.newest_s - ending.tick_s(ending.next_index)
            self.skipped_at_restart += max(int(left_s * TICK_HZ), 0)
            self._ending = None
        if self._rewind.apply(run, now_s):
            self.restarts += 1
            reached_s = self._schedule.reached_s(run, now_s)
        return self._take(run, reached_s, now_s)

    def next_poll_s(self, now_s: float) -> float:
        """Our clock when the next tick falls due if no frame arrives before: now if it is due already.

        Infinite before the first frame.
        """
        run, ending = self._run, self._ending
        if run is None:
            return np.inf
        if ending is not None:
            return max(self._schedule.next_poll_s(ending, True), now_s)
        is_due = self._schedule.due_s(run, run.next_index) <= self._schedule.reached_s(run, now_s) + TIME_TOLERANCE_S
        return now_s if is_due else max(self._schedule.next_poll_s(run, False), now_s)

    def awaited(self) -> tuple[str, float] | None:
        """The sender whose clock is the stream's, and the time of the frame that lets the next tick fall due.

        None if any frame may change when the next tick falls due.
        """
        source = self._senders.clock_owner()
        if self._run is None or source is None or self._ending is not None or not self._rewind.is_idle:
            return None
        return source, self._schedule.due_s(self._run, self._run.next_index) - TIME_TOLERANCE_S

    def health(self, now_s: float) -> dict[str, BodyHealth]:
        """How every body of this run arrives."""
        return {} if self._run is None else self._run.health(now_s)

    def recent(self, name: str, seconds: float) -> Array:
        """Tracked poses `(n, 7)` of a body in the newest `seconds` of the stream, oldest first."""
        return np.empty((0, 7)) if self._run is None else self._run.recent(name, seconds)

    def rebase(self, name: str, T_old_new: Array) -> None:
        """Re-base the history of a body after its offset changed by `T_old_new (7,)`, so that nothing jumps."""
        for run in (self._run, self._ending):
            if run is not None:
                run.rebase(name, T_old_new)

    def forget(self, name: str) -> None:
        """Forget a body and its history."""
        for run in (self._run, self._ending):
            if run is not None:
                run.tracks.pop(name, None)
        self._senders.forget(name)
        self._jumps.forget()

    def _begin(self, t_s: float, now_s: float) -> Run:
        """Start a run; the one before plays out by our clock until the first tick of the new one is due."""
        number = 0
        if self._run is None:
            self._schedule.begin()
        else:
            self.restarts += 1
            number = self._run.number + 1
            self._ending = self._ending or self._run
        self._jumps.forget()
        self._rewind.forget()
        self._run = Run(number, t_s, now_s, self._start_delay_s)
        return self._run

    def _doubt(self, run: Run, frame: HeldFrame, source: str) -> str | None:
        """Hold back a frame of an unlikely time; enough frames that agree start a new run."""
        if not self._senders.may_send(CLOCK, source, frame.now_s):
            return "other_sender"
        agreeing = self._jumps.hold(frame)
        if not agreeing:
            return drop_reason(run.arrivals, frame.t_s)
        self._senders.restart(frame.poses, source, frame.now_s)
        begun = self._begin(agreeing[0].t_s, agreeing[0].now_s)
        for held in agreeing:
            begun.add(held.t_s, held.poses, held.now_s)
        return None

    def _take(self, run: Run, reached_s: float, now_s: float) -> Tick | None:
        """The next tick of a run if stream time has reached it, after skipping a backlog."""
        late_s = reached_s + TIME_TOLERANCE_S - self._schedule.due_s(run, run.next_index)
        if late_s < 0.0:
            return None
        backlog = int(late_s * TICK_HZ)
        if backlog >= MAX_BACKLOG:
            self.skipped_late += backlog
            run.next_index += backlog
        tick = self._tick(run, now_s)
        run.carried_s = now_s if tick.silent else None
        run.next_index += 1
        self._schedule.slew()
        return tick

    def _tick(self, run: Run, now_s: float) -> Tick:
        time_s, due_s = run.tick_s(run.next_index), self._schedule.due_s(run, run.next_index)
        silent = due_s > run.arrivals.newest_s + TIME_TOLERANCE_S
        # A sender that has stopped is not forecast; its last pose stands.
        forecast = None if silent else self._forecast
        smoothing = self._smoother.follow(track.noise_at(time_s) for track in run.tracks.values())
        bodies = bodies_at(time_s, due_s, run.tracks, forecast, smoothing)
        return Tick(
            run=run.number,
            index=run.next_index,
            time_s=time_s,
            look_ahead_s=self._schedule.effective_s,
            waited_for_s=min(run.arrivals.reached_at_s(due_s), now_s),
            silent=silent,
            bodies=bodies,
        )
