"""Charts of the last half minute: rate, delay and the stages of each tick."""

import time
from collections import deque
from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array
from manipnet.page.state import STALE_S
from manipnet.wire import HandsMessage

SPAN_S: Final = 30.0
STEP_S: Final = 0.2
GAP_S: Final = 1.0
"""Nothing was measured between two rows that are farther apart."""
NO_VALUE: Final = -1000.0
"""What a chart shows in a gap: a value far below its range, so that there is no line. The rate is zero there."""
_COLUMNS: Final = ("t", "rate", "total", "sense", "infer", "ik")
_INK: Final = "rgba(128,138,153,0.95)"
_GRID: Final = {"stroke": "rgba(128,138,153,0.2)", "width": 1}


class History:
    """One row of measurements for every `STEP_S` seconds, taken from the messages."""

    def __init__(self) -> None:
        self._rows: deque[tuple[float, ...]] = deque(maxlen=int(SPAN_S / STEP_S))
        self._first: HandsMessage | None = None
        """The message with which the present step began."""
        self._latencies: list[tuple[float, ...]] = []
        self.newest_s = float("-inf")
        """When the newest message was published, by `time.monotonic`."""

    def rate_hz(self, now_s: float) -> float:
        """The present rate; zero if no message was published for longer than `STALE_S`."""
        return self._rows[-1][1] if self._rows and now_s - self.newest_s <= STALE_S else 0.0

    def note(self, message: HandsMessage) -> None:
        """Add one message of the actor."""
        first, latency = self._first, message.latency_ms
        is_next = 0.0 <= message.t_publish - self.newest_s <= GAP_S
        self.newest_s = message.t_publish
        if first is None or first.session != message.session or message.seq < first.seq or not is_next:
            self._first, self._latencies = message, []
            return
        own_ms = latency.total - latency.buffer
        self._latencies.append((own_ms, latency.sense, latency.infer, latency.ik))
        elapsed_s = message.t_publish - first.t_publish
        if elapsed_s >= STEP_S:
            rate_hz = (message.seq - first.seq) / elapsed_s
            self._rows.append((message.t_publish, rate_hz, *np.max(self._latencies, axis=0)))
            self._first, self._latencies = message, []

    def columns(self, now_s: float) -> dict[str, Array]:
        """`{name: (n,)}`: `t` is the time before now in seconds, and the others are the worst values of each step.

        In a gap, also in one that lasts until now, the rate is zero and the others are `NO_VALUE`.
        """
        rows = _with_gaps(list(self._rows), now_s)
        values = np.array(rows)
        values[:, 0] -= now_s
        return dict(zip(_COLUMNS, values.T.copy(), strict=True))


def _with_gaps(rows: list[tuple[float, ...]], now_s: float) -> list[tuple[float, ...]]:
    """The rows of the last `SPAN_S` up to now, with two more around each gap."""
    begin_s = now_s - SPAN_S
    rows = [row for row in rows if row[0] >= begin_s]
    result, before_s = list[tuple[float, ...]](), begin_s
    for row in [*rows, (now_s,)]:
        if row[0] - before_s > GAP_S:
            nothing = (0.0, *[NO_VALUE] * (len(_COLUMNS) - 2))
            result += [(before_s + 1e-3, *nothing), (row[0] - 1e-3, *nothing)]
        result += [row] if len(row) > 1 else []
        before_s = row[0]
    return result or [(begin_s, 0.0, *[NO_VALUE] * 4), (now_s, 0.0, *[NO_VALUE] * 4)]


class Plots:
    """The charts in one visitor's panel."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._rate = _chart(gui, "Hands per second, last 30 s", (("hands/s", "#3b8eea"),), (0.0, 70.0))
        self._delay = _chart(
            gui, "Work per tick, ms (16.7 are available)", (("packet to hands", "#e08a3c"),), (0.0, 18.0)
        )
        with gui.add_folder("Stages of a tick", expand_by_default=False):
            colors = (("sense", "#4fbf67"), ("network", "#a98ae6"), ("contacts", "#f0645a"))
            self._stages = _chart(gui, "Milliseconds", colors, (0.0, 3.0))

    def show(self, history: History) -> None:
        """Draw the newest rows."""
        columns = history.columns(time.monotonic())
        self._rate.data = (columns["t"], columns["rate"])
        self._delay.data = (columns["t"], columns["total"])
        self._stages.data = tuple(columns[name] for name in ("t", "sense", "infer", "ik"))


def _chart(
    gui: viser.GuiApi, title: str, series: tuple[tuple[str, str], ...], span: tuple[float, float]
) -> viser.GuiUplotHandle:
    axis = {"stroke": _INK, "grid": _GRID, "ticks": _GRID, "font": "11px sans-serif"}
    empty = np.array([-SPAN_S, 0.0])
    return gui.add_uplot(
        data=(empty, *(np.full(2, NO_VALUE),) * len(series)),
        series=({"label": "s"}, *({"label": name, "stroke": color, "width": 2} for name, color in series)),  # pyright: ignore
        title=title,
        scales={"x": {"time": False, "range": (-SPAN_S, 0.0)}, "y": {"range": span}},  # pyright: ignore
        axes=({**axis, "size": 26}, {**axis, "size": 34}),  # pyright: ignore
        legend={"show": len(series) > 1, "live": False},
        height=120 if len(series) == 1 else 165,
    )
