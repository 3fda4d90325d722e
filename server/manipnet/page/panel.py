"""The panel of one visitor: how things stand for everybody, controls for those who may."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import viser

from manipnet.page.calibrate_tab import CalibrateTab
from manipnet.page.charts import History, Plots
from manipnet.page.frames import Frame
from manipnet.page.objects_tab import ObjectsTab
from manipnet.page.overlays import OVERLAYS
from manipnet.page.rpc import RefusedError
from manipnet.page.takes_tab import TakesTab

if TYPE_CHECKING:
    from manipnet.page.app import Page

DOTS = {"live": "●", "hold": "◐", "rest": "○"}
NOTE_S = 6.0


class Panel:
    """Built when a visitor comes. An operator sits on this machine; others only look."""

    def __init__(self, page: "Page", client: viser.ClientHandle, operator: bool) -> None:
        self._page, self._client = page, client
        self.objects: ObjectsTab | None = None
        self._takes: TakesTab | None = None
        self._calibration: CalibrateTab | None = None
        self._paused = False
        gui = client.gui
        gui.main_panel.dock_right()
        self._headline = gui.add_markdown("**connecting …**")
        if operator:
            self._controls(gui)
            tabs = gui.add_tab_group()
            with tabs.add_tab("Scene"):
                self._scene(gui)
            with tabs.add_tab("Objects"):
                self.objects = ObjectsTab(page, client, self.doing)
            with tabs.add_tab("Takes"):
                self._takes = TakesTab(page, gui, self.doing)
            with tabs.add_tab("Calibrate"):
                self._calibration = CalibrateTab(page, gui, self.doing)
        side = gui.add_panel()
        with side.add_tab("Health", viser.Icon.HEARTBEAT):
            self._health = gui.add_markdown("")
            self._plots = Plots(gui)
        side.dock_left()

    def refresh(self) -> None:
        """Bring it up to date, twice a second."""
        try:
            self._refresh()
        except RefusedError as error:
            self._headline.content = f"**the server does not answer:** {error}"

    def _refresh(self) -> None:
        history = next(iter(self._page.histories.values()), None) or History()
        status = self._page.link.ask(op="status")
        self._headline.content = _headline(self._page, status, history)
        self._health.content = _health(status)
        self._plots.show(history)
        if self.objects is not None and self._takes is not None and self._calibration is not None:
            self._show_paused(_paused(status))
            answer = self._page.link.ask(op="objects")
            self.objects.refresh(answer)
            self._calibration.refresh(answer["bodies"])
            self._takes.refresh()

    def follow(self, frame: Frame | None) -> None:
        """Let what hangs on a prop be where it is at a tick; None for a recording."""
        if self.objects is not None:
            self.objects.follow(frame)

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
        rest = gui.add_button(
            "Rest", icon=viser.Icon.HAND_STOP, hint="ease the hands to their rest pose, to begin anew"
        )
        self._on_click(self._pause, self._toggle_pause)
        self._on_click(rest, self._ask(op="rest"))

    def _scene(self, gui: viser.GuiApi) -> None:
        slider = gui.add_slider("Look-ahead, ms", 0, 500, 10, initial_value=500)
        slider.on_update(lambda event: self._change_look_ahead(event, slider))
        self._look_ahead = slider
        for name, label in OVERLAYS.items():
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

    def _show_paused(self, paused: bool) -> None:
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
        return "○ **Waiting for bodies**: `manipnet doctor` says why nothing arrives"
    latency = next(iter(frames)).message.latency_ms
    what = "◐ **Paused**" if _paused(status) else "● **Live**"
    if page.recording is not None:
        what = f"▶ **{page.recording.name}**"
    waits = f"{latency.buffer:.0f} ms look-ahead + {latency.total - latency.buffer:.1f} ms work"
    return f"{what} · {history.rate_hz:.0f} hands/s\n\n{waits}"


def _paused(status: dict[str, Any]) -> bool:
    return any(actor.get("paused") for actor in status["actors"].values())


def _health(status: dict[str, Any]) -> str:
    rows = ["| | body | per s | seen |", "|---|---|--:|--:|"]
    hands = []
    for name, actor in status["actors"].items():
        if len(status["actors"]) > 1:
            rows.append(f"| | **{name}** | | |")
        for body, health in actor["bodies"].items():
            age_s, rate_hz = health["age_s"], health["rate_hz"]
            age = "never" if age_s is None or not math.isfinite(age_s) else _ago(age_s)
            rows.append(f"| {DOTS[health['state']]} | {body} | {rate_hz or 0.0:.0f} | {age} |")
        for side, hand in actor["hands"].items():
            hands.append(f"{side} hand **{hand['state']}**" + (f" on {hand['object']}" if hand["object"] else ""))
    counters = status["counters"]
    lost = sum(sum(counters.get(name, {}).values()) for name in ("frames_dropped", "bodies_rejected"))
    refused = f"{lost} frames and bodies refused" if lost else "nothing refused"
    return "\n".join(rows) + "\n\n" + "\n\n".join([*hands, f"{refused} since the start"])


def _ago(age_s: float) -> str:
    return f"{1e3 * age_s:.0f} ms" if age_s < 1.0 else f"{age_s:.0f} s ago"
