"""The panel of one visitor: how things stand for everybody, controls for those who may."""

import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import viser

from manipnet.page.layers import LAYERS
from manipnet.page.link import RefusedError
from manipnet.page.objects_tab import ObjectsTab
from manipnet.page.plots import History, Plots
from manipnet.page.takes_tab import TakesTab

if TYPE_CHECKING:
    from manipnet.page.process import Page

DOTS = {"live": "●", "hold": "◐", "rest": "○"}
NOTE_S = 6.0
COUNTDOWN_S = 3
"""From the click to the request, which looks back 2 s: the hand that clicked must lie still by then."""
SHEET = """Lay both hands flat on the calibration sheet (`docs/calibration.md`), wrists on its marks, click, and keep
still until the countdown ends. Then, for the size of the hands, touch its centre line with the fingertips."""


class Panel:
    """Built when a visitor comes. An operator sits on this machine; others only look."""

    def __init__(self, page: "Page", client: viser.ClientHandle, operator: bool) -> None:
        self._page, self._client = page, client
        self.objects: ObjectsTab | None = None
        self._takes: TakesTab | None = None
        self._paused = False
        gui = client.gui
        gui.main_panel.dock_right()
        self._headline = gui.add_markdown("**connecting …**")
        if operator:
            self._controls(gui)
            tabs = gui.add_tab_group()
            with tabs.add_tab("Scene", viser.Icon.STACK_2):
                self._scene(gui)
            with tabs.add_tab("Objects", viser.Icon.CUBE):
                self.objects = ObjectsTab(page, gui, self.doing)
            with tabs.add_tab("Takes", viser.Icon.MOVIE):
                self._takes = TakesTab(page, gui, self.doing)
            with tabs.add_tab("Calibrate", viser.Icon.RULER_MEASURE):
                self._calibration(gui)
        side = gui.add_panel()
        with side.add_tab("Health", viser.Icon.HEARTBEAT):
            self._health = gui.add_markdown("")
            self._plots = Plots(gui)
        side.dock_left()

    def refresh(self) -> None:
        """Bring it up to date, twice a second."""
        history = next(iter(self._page.histories.values()), None) or History()
        try:
            status = self._page.link.ask(op="status")
        except RefusedError as error:
            self._headline.content = f"**the server does not answer:** {error}"
            return
        self._headline.content = _headline(self._page, status, history)
        self._health.content = _health(status)
        self._plots.show(history)
        if self.objects is not None and self._takes is not None:
            self._show_paused(status)
            self.objects.refresh()
            self._takes.refresh()

    def doing(self, action: Callable[[], str | None]) -> None:
        """Do what the visitor asked for, and tell how it went where there is anything to tell."""
        try:
            text = action()
        except (RefusedError, ValueError, OSError) as error:
            self._client.add_notification("That did not work", str(error), color="red", auto_close_seconds=3 * NOTE_S)
        else:
            if text:
                self._client.add_notification("Done", text, color="green", auto_close_seconds=NOTE_S)

    def _controls(self, gui: viser.GuiApi) -> None:
        self._pause = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE, hint="hold the hands where they are")
        rest = gui.add_button("Rest", icon=viser.Icon.HAND_STOP, hint="ease the hands to their rest pose")
        self._on_click(self._pause, self._toggle_pause)
        self._on_click(rest, self._ask(op="rest"))

    def _calibration(self, gui: viser.GuiApi) -> None:
        gui.add_markdown(SHEET)
        wrists = gui.add_button("Hands are on the marks", icon=viser.Icon.HAND_STOP)
        tips = gui.add_button("Fingertips touch the line", icon=viser.Icon.HAND_FINGER)
        self._on_click(wrists, lambda: self._calibrate("wrists", wrists))
        self._on_click(tips, lambda: self._calibrate("fingertips", tips))

    def _scene(self, gui: viser.GuiApi) -> None:
        slider = gui.add_slider("Look-ahead, ms", 0, 500, 10, initial_value=500)
        slider.on_update(lambda event: self._change_look_ahead(event, slider))
        self._look_ahead = slider
        for name, label in LAYERS.items():
            box = gui.add_checkbox(label, name in self._page.layers)
            box.on_update(lambda event, name=name: self._toggle(name, event.target.value))
        center = gui.add_button("Center the view", icon=viser.Icon.FOCUS_2)
        self._on_click(center, self._page.recenter)

    def _toggle(self, layer: str, shown: bool) -> None:
        self._page.layers = self._page.layers | {layer} if shown else self._page.layers - {layer}

    def _change_look_ahead(self, event: viser.GuiEvent[Any], slider: viser.GuiSliderHandle[int]) -> None:
        if event.client is not None:  # not what we set ourselves
            self.doing(self._ask(op="look_ahead", seconds=1e-3 * slider.value))

    def _toggle_pause(self) -> None:
        self._page.link.ask(op="pause", on=not self._paused)

    def _calibrate(self, step: str, button: viser.GuiButtonHandle) -> str:
        label, button.disabled = button.label, True
        try:
            for left in range(COUNTDOWN_S, 0, -1):
                button.label = f"Keep still … {left}"
                time.sleep(1.0)
            answer = self._page.link.ask(op="calibrate", step=step)
        finally:
            button.label, button.disabled = label, False
        kept = f"kept in {answer['stored']}" if answer.get("stored") else answer.get("note", "")
        return f"quality {answer['quality']}, hands {answer['hand_scale']:.3f} times the model's; {kept}"

    def _show_paused(self, status: dict[str, Any]) -> None:
        paused = any(actor.get("paused") for actor in status["actors"].values())
        if paused != self._paused:
            self._paused = paused
            self._pause.label = "Go on" if paused else "Pause"
            self._pause.icon = viser.Icon.PLAYER_PLAY if paused else viser.Icon.PLAYER_PAUSE

    def _ask(self, **request: Any) -> Callable[[], None]:
        def ask() -> None:
            self._page.link.ask(**request)

        return ask

    def _on_click(self, button: viser.GuiButtonHandle, action: Callable[[], str | None]) -> None:
        button.on_click(lambda _: self.doing(action))


def _headline(page: "Page", status: dict[str, Any], history: History) -> str:
    frames = page.live.values()
    if not frames:
        return "○ **Waiting for bodies** — `manipnet doctor` says why nothing arrives"
    latency = next(iter(frames)).message.latency_ms
    what = f"▶ **{page.recording.name}**" if page.recording is not None else "● **Live**"
    waits = f"{latency.buffer:.0f} ms ahead + {latency.total - latency.buffer:.1f} ms"
    return f"{what} · {history.rate_hz:.0f} hands/s · {waits}"


def _health(status: dict[str, Any]) -> str:
    rows = ["| | body | samples/s | last seen |", "|---|---|--:|--:|"]
    for name, actor in status["actors"].items():
        if len(status["actors"]) > 1:
            rows.append(f"| | **{name}** | | |")
        for body, health in actor["bodies"].items():
            age_s, rate_hz = health["age_s"], health["rate_hz"]
            age = "never" if age_s is None or not math.isfinite(age_s) else f"{1e3 * age_s:.0f} ms"
            rows.append(f"| {DOTS[health['state']]} | {body} | {rate_hz or 0.0:.0f} | {age} |")
        hands = ", ".join(f"{side} {hand['state']}" for side, hand in actor["hands"].items())
        rows.append(f"| | {hands} | | |")
    counters = status["counters"]
    lost = sum(sum(counters.get(name, {}).values()) for name in ("frames_dropped", "bodies_rejected"))
    return "\n".join(rows) + f"\n\n{lost} frames and bodies refused since the start"
