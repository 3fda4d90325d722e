"""Charts of the last half minute: rate, delay and the stages of each tick."""

from collections import deque
from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array
from manipnet.wire import HandsMessage

SPAN_S: Final = 30.0
STEP_S: Final = 0.2
_COLUMNS: Final = ("t", "rate", "total", "sense", "infer", "ik")
_EMPTY: Final = np.array([-SPAN_S, 0.0])
"""The time span of an empty chart; a span of zero would keep the browser busy forever."""
_INK: Final = "rgba(150,160,175,0.9)"
_GRID: Final = {"stroke": "rgba(150,160,175,0.18)", "width": 1}


class History:
    """One row of measurements for every `STEP_S` seconds, taken from the messages."""

    def __init__(self) -> None:
        self._rows: deque[tuple[float, ...]] = deque(maxlen=int(SPAN_S / STEP_S))
        self._last: HandsMessage | None = None
        self._latencies: list[tuple[float, ...]] = []

    @property
    def rate_hz(self) -> float:
        """The newest rate; zero before the first row."""
        return self._rows[-1][1] if self._rows else 0.0

    def note(self, message: HandsMessage) -> None:
        """Add one message of the actor."""
        last, latency = self._last, message.latency_ms
        if last is None or last.session != message.session or message.seq < last.seq:
            self._last, self._latencies = message, []
            return
        own_ms = latency.total - latency.buffer
        self._latencies.append((own_ms, latency.sense, latency.infer, latency.ik))
        elapsed_s = message.t_publish - last.t_publish
        if elapsed_s >= STEP_S:
            rate_hz = (message.seq - last.seq) / elapsed_s
            self._rows.append((message.t_publish, rate_hz, *np.max(self._latencies, axis=0)))
            self._last, self._latencies = message, []

    def columns(self) -> dict[str, Array]:
        """`{name: (n,)}`: `t` is the time before now in seconds, and the others are the worst values of each step."""
        if len(self._rows) < 2:
            return dict(zip(_COLUMNS, (_EMPTY, *[np.zeros(2)] * (len(_COLUMNS) - 1)), strict=True))
        rows = np.array(self._rows)
        rows[:, 0] -= rows[-1, 0]
        return dict(zip(_COLUMNS, rows.T.copy(), strict=True))


class Plots:
    """The charts in one visitor's panel."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._rate = _chart(gui, "Hands per second, last 30 s", (("hands/s", "#58a6ff"),), (0.0, 80.0))
        self._delay = _chart(gui, "Processing per tick, ms", (("packet to hands", "#f2a65a"),))
        colors = (("sense", "#7ee787"), ("network", "#d2a8ff"), ("IK", "#ff7b72"))
        self._stages = _chart(gui, "Stages, ms", colors)

    def show(self, history: History) -> None:
        """Draw the newest rows."""
        columns = history.columns()
        self._rate.data = (columns["t"], columns["rate"])
        self._delay.data = (columns["t"], columns["total"])
        self._stages.data = tuple(columns[name] for name in ("t", "sense", "infer", "ik"))


def _chart(
    gui: viser.GuiApi, title: str, series: tuple[tuple[str, str], ...], span: tuple[float, float] | None = None
) -> viser.GuiUplotHandle:
    axis = {"stroke": _INK, "grid": _GRID, "ticks": _GRID, "font": "11px sans-serif"}
    return gui.add_uplot(
        data=(_EMPTY, *(np.zeros(2),) * len(series)),
        series=({"label": "s"}, *({"label": name, "stroke": color, "width": 2} for name, color in series)),  # pyright: ignore
        title=title,
        scales={"x": {"time": False, "range": (-SPAN_S, 0.0)}, "y": {"range": span} if span else {"auto": True}},  # pyright: ignore
        axes=({**axis, "size": 26}, {**axis, "size": 44}),  # pyright: ignore
        legend={"show": len(series) > 1, "live": False},
        height=120 if len(series) == 1 else 165,
    )
