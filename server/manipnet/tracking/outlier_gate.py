"""Takes samples out of a frame that cannot be real: jumps, swapped identities, frozen poses, zeros.

A rejected body is passed on as not tracked, with the reason as its `fault`; the hands decide what to show for a lost
body. The timeline deals with time that goes backwards and with duplicate and late frames. No clock, no I/O.
"""

from operator import itemgetter
from typing import Final

import numpy as np

from manipnet.tracking.outliers import FAULT, FAULTS, HISTORY, judge
from manipnet.wire.bodies import BodyFrame, BodySample

MAX_BODIES: Final = 1_024
_FIRST_ROOM: Final = 16

Key = tuple[int | None, str | None]
"""Id and name of a body."""
_key = itemgetter(BodySample._fields.index("id"), BodySample._fields.index("name"))


class OutlierGate:
    """Judges the bodies of any number of senders, each by its own past. Not thread-safe."""

    def __init__(self) -> None:
        self._histories = np.zeros(_FIRST_ROOM, HISTORY)
        self._forget()

    @property
    def known_bodies(self) -> int:
        """The number of bodies whose past is known, at most `MAX_BODIES`."""
        return len(self._rows)

    def check(self, frame: BodyFrame) -> tuple[BodyFrame, list[str]]:
        """The frame with impossible bodies made untracked, and the reasons, of `telemetry.BODY_REASONS`."""
        bodies = frame.bodies
        if not bodies:
            return frame, []
        rows = self._rows_of(frame.source, [*map(_key, bodies)])
        samples = np.array([(*body.p, *body.q, not body.tracked) for body in bodies], np.float64)
        moved_s = self._moved_s.get(frame.source, frame.t_s)
        changed, faulty = judge(self._histories, rows, samples, frame.t_s, moved_s)
        if changed:
            self._moved_s[frame.source] = frame.t_s
        if faulty:
            bodies = tuple(map(_with_fault, bodies, samples[:, FAULT].astype(int).tolist()))
            frame = frame._replace(bodies=bodies)
        return frame, [body.fault for body in bodies if body.fault is not None]

    def _forget(self) -> None:
        self._histories[:] = 0
        self._rows: dict[tuple[str, Key], int] = {}
        self._layouts: dict[str, tuple[list[Key], np.ndarray]] = {}
        """By sender, the bodies of its newest frame and the rows of their histories."""
        self._moved_s: dict[str, float] = {}

    def _rows_of(self, source: str, keys: list[Key]) -> np.ndarray:
        """The rows of the histories of a sender's bodies. Most frames have the same bodies as the one before."""
        known, rows = self._layouts.get(source, (None, _NO_ROWS))
        if known == keys:
            return rows
        if len(self._rows) + sum((source, key) not in self._rows for key in keys) > MAX_BODIES:
            self._forget()
        rows = np.array([self._rows.setdefault((source, key), len(self._rows)) for key in keys], np.intp)
        if len(self._rows) > len(self._histories):
            more = np.zeros(2 * len(self._rows) - len(self._histories), HISTORY)
            self._histories = np.concatenate([self._histories, more])
        self._layouts[source] = keys, rows
        return rows


_NO_ROWS: Final = np.empty(0, np.intp)


def _with_fault(body: BodySample, fault: int) -> BodySample:
    """A tracked body with its fault, by number."""
    return body._replace(tracked=False, fault=FAULTS[fault - 1]) if body.tracked and fault else body
