"""One run of a sender's clock: its frames, and the ticks that are counted from the first of them."""

import math
from typing import Final

import numpy as np

from manipnet.geometry import Array, compose
from manipnet.tracking.arrivals import Arrivals
from manipnet.tracking.pose_buffer import TIME_TOLERANCE_S, PoseBuffer
from manipnet.tracking.tick import CURRENT_S, TICK_HZ, BodyHealth, Poses

VANISHED_S: Final = 0.1
"""A tick waits no longer than this for one body while frames with others arrive."""
TURN: Final = 0.618
"""The noise of each body is estimated this share of the time between two estimates after the body before it, so that
few are estimated at the same frame."""


class Run:
    """The frames of one run; tick `k` of it is the instant `t0_s + k / TICK_HZ`.

    `t0_s` is the time of a frame: of the first one that comes `delay_s` after the run began, or later.
    """

    def __init__(self, number: int, t_s: float, now_s: float, delay_s: float = 0.0) -> None:
        self.number, self.t0_s = number, t_s + delay_s
        self.arrivals = Arrivals(t_s, now_s)
        self.tracks: dict[str, PoseBuffer] = {}
        self.next_index = 0
        """The next tick to show."""
        self.carried_s: float | None = None
        """Our clock when it let the newest tick go without its frames; None if the frames had arrived."""

    def add(self, t_s: float, poses: Poses, now_s: float) -> int:
        """Take a frame, in which None stands for a body that is not tracked; returns the number of duplicate poses."""
        if self.arrivals.newest_s < self.t0_s <= t_s and self.next_index == 0:
            self.t0_s = t_s
        self.arrivals.note(t_s, now_s)
        duplicates = 0
        for name, pose in poses.items():
            track = self.tracks.get(name)
            if track is None:  # setdefault would allocate a buffer for every pose
                track = self.tracks[name] = PoseBuffer(len(self.tracks) * TURN % 1.0)
            track.seen_s = max(track.seen_s, t_s)
            duplicates += pose is not None and not track.add(t_s, pose)
        return duplicates

    def tick_s(self, index: int) -> float:
        """The instant of a tick."""
        return self.t0_s + index / TICK_HZ

    def index_at(self, t_s: float) -> int:
        """The first tick at or after an instant."""
        return math.ceil((t_s - self.t0_s) * TICK_HZ - TIME_TOLERANCE_S)

    def arrived_s(self) -> float:
        """Stream time up to which every body that is still being sent has arrived."""
        newest_s = reached_s = self.arrivals.newest_s
        for track in self.tracks.values():
            lag_s = newest_s - track.seen_s
            if 0.0 < lag_s <= min(2.5 * track.interval_s(), VANISHED_S):
                reached_s = min(reached_s, track.seen_s)
        return reached_s

    def health(self, now_s: float) -> dict[str, BodyHealth]:
        """How every body of this run arrives."""
        clock_s = self.arrivals.clock_s(now_s)
        return {
            name: BodyHealth(
                1.0 / track.interval_s() if track.age_s(clock_s) <= CURRENT_S else 0.0,
                track.age_s(clock_s),
                track.noise,
            )
            for name, track in self.tracks.items()
        }

    def recent(self, name: str, seconds: float) -> Array:
        """Tracked poses `(n, 7)` of a body in the newest `seconds` of the run, oldest first."""
        track = self.tracks.get(name)
        if track is None:
            return np.empty((0, 7))
        return track.poses[track.times >= self.arrivals.newest_s - seconds].copy()

    def rebase(self, name: str, T_old_new: Array) -> None:
        """Express the history of a body by a frame that sits at `T_old_new (7,)` in the one so far."""
        if name in self.tracks:
            poses = self.tracks[name].poses
            poses[:] = compose(poses, T_old_new)
