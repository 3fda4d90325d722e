"""The panel of one visitor: the state of the server for everybody, and controls for operators."""

import math
from typing import Any

import viser

from manipnet.page.calibrate_tab import CalibrateTab
from manipnet.page.charts import History, Plots
from manipnet.page.controls import Action, Ask, by_visitor
from manipnet.page.doctor_text import doctor_text
from manipnet.page.frames import Frame
from manipnet.page.markdown import escape
from manipnet.page.objects_tab import ObjectsTab
from manipnet.page.overlays import OVERLAYS
from manipnet.page.rpc import RefusedError
from manipnet.page.show import Show
from manipnet.page.takes_tab import TakesTab

DOTS = {"live": "●", "hold": "◐", "rest": "○"}
NOTE_S = 6.0


class Panel:
    """The panel beside the scene. A visitor on the server's own machine is an operator; the others can only watch."""

    def __init__(self, ask: Ask, show: Show, client: viser.ClientHandle, operator: bool) -> None:
        self._ask, self._show, self._client = ask, show, client
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
                self.objects = ObjectsTab(ask, client, self.perform)
            with tabs.add_tab("Takes"):
                self._takes = TakesTab(ask, show, gui, self.perform)
            with tabs.add_tab("Calibrate"):
                self._calibration = CalibrateTab(ask, gui, self.perform)
        side = gui.add_panel()
        with side.add_tab("Health", viser.Icon.HEARTBEAT):
            self._health = gui.add_markdown("")
            self._doctor = gui.add_markdown("")
            self._plots = Plots(gui)
        side.dock_left()

    def refresh(self) -> None:
        """Show the newest state of the server; called twice a second."""
        try:
            self._refresh()
        except RefusedError as error:
            self._headline.content = f"**The server does not answer:** {escape(error)}"

    def _refresh(self) -> None:
        history = next(iter(self._show.histories.values()), None) or History()
        status = self._ask(op="status")
        self._headline.content = _headline(self._show, status, history)
        self._health.content = _health(status)
        self._doctor.content = doctor_text(status["doctor"])
        self._plots.show(history)
        if self.objects is not None and self._takes is not None and self._calibration is not None:
            self._show_paused(_paused(status))
            answer = self._ask(op="objects")
            self.objects.refresh(answer)
            self._calibration.refresh(answer["bodies"])
            self._takes.refresh()

    def follow(self, frame: Frame | None) -> None:
        """Move the gizmo with its prop, as it is in a live frame; None hides it while a recording is shown."""
        if self.objects is not None:
            self.objects.follow(frame)

    def perform(self, action: Action) -> None:
        """Run an action and notify the visitor of its message or its error."""
        try:
            text = action()
        except (RefusedError, ValueError, OSError) as error:
            self._client.add_notification("Failed", str(error), color="red", auto_close_seconds=3 * NOTE_S)
        else:
            if text:
                self._client.add_notification("Done", text, color="green", auto_close_seconds=NOTE_S)

    def _controls(self, gui: viser.GuiApi) -> None:
        self._pause = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE, hint="keep the hands as they are")
        rest = gui.add_button(
            "Rest", icon=viser.Icon.HAND_STOP, hint="ease both hands to the rest pose and start again from there"
        )
        self._on_click(self._pause, self._toggle_pause)
        self._on_click(rest, self._asking(op="rest"))

    def _scene(self, gui: viser.GuiApi) -> None:
        slider = gui.add_slider("Look-ahead, ms", 0, 500, 10, initial_value=500)
        slider.on_update(by_visitor(lambda: self.perform(self._asking(op="look_ahead", seconds=1e-3 * slider.value))))
        for name, label in OVERLAYS.items():
            box = gui.add_checkbox(label, name in self._show.overlays)
            box.on_update(lambda event, name=name: self._show.set_overlay(name, event.target.value))
        center = gui.add_button("Center view", icon=viser.Icon.FOCUS_2)
        self._on_click(center, self._show.recenter)

    def _toggle_pause(self) -> None:
        self._ask(op="pause", on=not self._paused)

    def _show_paused(self, paused: bool) -> None:
        if paused != self._paused:
            self._paused = paused
            self._pause.label = "Resume" if paused else "Pause"
            self._pause.icon = viser.Icon.PLAYER_PLAY if paused else viser.Icon.PLAYER_PAUSE

    def _asking(self, **request: Any) -> Action:
        def ask() -> None:
            self._ask(**request)

        return ask

    def _on_click(self, button: viser.GuiButtonHandle, action: Action) -> None:
        button.on_click(lambda _: self.perform(action))


def _headline(show: Show, status: dict[str, Any], history: History) -> str:
    return "\n\n".join([*_warnings(status), _activity(show, status, history)])


def _warnings(status: dict[str, Any]) -> list[str]:
    """Warnings about sockets that have failed, and about a server that anybody may use."""
    warnings = [
        f"⚠ **{escape(name)} is down** and will be opened again: {escape(receiver['error'])}"
        for name, receiver in status.get("receivers", {}).items()
        if receiver["state"] == "down"
    ]
    if status.get("exposed"):
        warnings.append("⚠ **Open to every machine** that reaches this one (`--insecure`)")
    return warnings


def _activity(show: Show, status: dict[str, Any], history: History) -> str:
    frames = show.live.values()
    if not frames:
        return "○ **Waiting for bodies.** *Health* says why none are used."
    latency = next(iter(frames)).message.latency_ms
    what = "◐ **Paused**" if _paused(status) else "● **Live**"
    if show.recording is not None:
        what = f"▶ **{escape(show.recording.name)}**"
    waits = f"{latency.buffer:.0f} ms look-ahead + {latency.total - latency.buffer:.1f} ms processing"
    return f"{what} · {history.rate_hz:.0f} hands/s\n\n{waits}"


def _paused(status: dict[str, Any]) -> bool:
    return any(actor.get("paused") for actor in status["actors"].values())


def _health(status: dict[str, Any]) -> str:
    rows = ["| | body | Hz | last seen |", "|---|---|--:|--:|"]
    hands = []
    for name, actor in status["actors"].items():
        if len(status["actors"]) > 1:
            rows.append(f"| | **{escape(name)}** | | |")
        for body, health in actor["bodies"].items():
            age_s, rate_hz = health["age_s"], health["rate_hz"]
            age = "never" if age_s is None or not math.isfinite(age_s) else _ago(age_s)
            rows.append(f"| {DOTS[health['state']]} | {escape(body)} | {rate_hz or 0.0:.0f} | {age} |")
        for side, hand in actor["hands"].items():
            hands.append(
                f"{side} hand **{hand['state']}**" + (f" on {escape(hand['object'])}" if hand["object"] else "")
            )
    counters = status["counters"]
    lost = sum(sum(counters.get(name, {}).values()) for name in ("frames_dropped", "bodies_rejected"))
    refused = f"{lost} frames and bodies refused" if lost else "no frame or body refused"
    return "\n".join(rows) + "\n\n" + "\n\n".join([*hands, f"{refused} since the server started"])


def _ago(age_s: float) -> str:
    return f"{1e3 * age_s:.0f} ms ago" if age_s < 1.0 else f"{age_s:.0f} s ago"
