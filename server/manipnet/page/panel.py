"""The panel of one visitor: the state of the server for everybody, and controls for operators."""

import threading
import time
from collections.abc import Sequence
from typing import Any, Final

import viser

from manipnet.page import html
from manipnet.page.calibrate_tab import CalibrateTab
from manipnet.page.charts import History, Plots
from manipnet.page.controls import Action, Ask
from manipnet.page.doctor_text import doctor_text
from manipnet.page.frames import Frame
from manipnet.page.framing import FollowCamera
from manipnet.page.hand_choices import HandChoices
from manipnet.page.hands_tab import HandsTab
from manipnet.page.markdown import escape
from manipnet.page.objects_tab import ObjectsTab
from manipnet.page.presets import Presets
from manipnet.page.refusals import refusals_text
from manipnet.page.rpc import RefusedError
from manipnet.page.show import Show
from manipnet.page.state import STALE_S, Verdict, ago, verdict
from manipnet.page.take_view import TakeView
from manipnet.page.takes_tab import TakesTab
from manipnet.page.transport import Transport
from manipnet.page.view_tab import ViewTab

DOTS: Final = {"live": "●", "hold": "◐", "rest": "○"}
NOTE_S: Final = 6.0
NARROW_PX: Final = 900
"""In a window that is narrower, the panel *Health* begins folded, so that the stage has room."""


class Panel:
    """The panel beside the scene. A visitor on the server's own machine is an operator; the others can only watch."""

    def __init__(self, ask: Ask, show: Show, choices: HandChoices, client: viser.ClientHandle, operator: bool) -> None:
        self._ask, self._show, self._choices, self._client = ask, show, choices, client
        self._hands: HandsTab | None = None
        self.objects: ObjectsTab | None = None
        self._takes: TakesTab | None = None
        self._calibration: CalibrateTab | None = None
        self._paused = False
        self._camera = FollowCamera(client)
        self._view = TakeView(client, show.look, self._camera)
        gui = client.gui
        gui.main_panel.dock_right()
        self._headline = gui.add_html("")
        self._warnings = gui.add_markdown("")
        self._stage = gui.add_html("")
        self._transport = Transport(ask, client, self._view, self.perform, operator)
        if operator:
            self._controls(gui)
        tabs = gui.add_tab_group()
        with tabs.add_tab("View"):
            self._view_tab = ViewTab(ask, show, client, self._camera, self.perform, operator)
            self._presets = Presets(ask, client, self._view_tab, self.perform, operator)
        if operator:
            with tabs.add_tab("Objects"):
                self.objects = ObjectsTab(ask, client, self.perform)
            with tabs.add_tab("Hands"):
                self._hands = HandsTab(choices, gui, self.perform)
            with tabs.add_tab("Takes"):
                self._takes = TakesTab(ask, client, self._transport, self.perform)
            with tabs.add_tab("Calibrate"):
                self._calibration = CalibrateTab(ask, gui, self.perform)
        side = gui.add_panel()
        with side.add_tab("Health", viser.Icon.HEARTBEAT):
            self._health = gui.add_markdown("")
            self._doctor = gui.add_markdown("")
            self._plots = Plots(gui)
        side.dock_left()
        if client.camera.image_width < NARROW_PX:
            side.minimize()
        threading.Thread(target=self._remember, name="remember", daemon=True).start()

    def refresh(self) -> None:
        """Show the newest state of the server; called twice a second."""
        try:
            self._refresh()
        except RefusedError as error:
            self._headline.content = html.state_line(Verdict("bad", "The server does not answer"), str(error))

    def close(self) -> None:
        """The visitor has left."""
        self._transport.close()
        self._view_tab.close()

    def follow(self, frames: Sequence[Frame]) -> None:
        """Move the camera and the gizmo with what was drawn live, unless this visitor watches a take."""
        if self._view.recording is None:
            self._camera.follow(self._show.focus)
        if self.objects is not None:
            self.objects.follow(frames if self._view.recording is None else ())

    def wear(self, name: str, content: bytes) -> str:
        """Import the hands of an avatar file for the chosen actor. Raises `RefusedError` and `ValueError`."""
        assert self._hands is not None
        return self._hands.use(self._choices.add(name, content))

    def perform(self, action: Action) -> None:
        """Run an action and notify the visitor of its message or its error."""
        try:
            text = action()
        except (RefusedError, ValueError, OSError) as error:
            self._client.add_notification("Failed", str(error), color="red", auto_close_seconds=3 * NOTE_S)
        else:
            if text:
                self._client.add_notification("Done", text, color="green", auto_close_seconds=NOTE_S)

    def _remember(self) -> None:
        """Ask the browser what it has kept; on a thread of its own, because an answer takes a while."""
        self._view_tab.remember()
        self._presets.remember()

    def _refresh(self) -> None:
        now_s = time.monotonic()
        history = next(iter(self._show.histories.values()), None) or History()
        status = self._ask(op="status")
        state = verdict(status, history.rate_hz(now_s))
        recording = self._ask(op="recordings")["recording"]
        self._transport.refresh(recording)
        self._headline.content = self._headline_of(state, history)
        waits = state.text != "Paused" and not self._show_is_fresh(history, now_s) and self._view.recording is None
        self._stage.content = html.recording_mark(recording) + (html.card(state, status) if waits else "")
        self._warnings.content = "\n\n".join(_warnings(status))
        self._health.content = _health(status)
        self._doctor.content = doctor_text(status["doctor"])
        self._plots.show(history)
        self._view_tab.refresh(next(iter(status["actors"].values()))["look_ahead_s"])
        if not self._show.live and self._view.recording is None:
            self._camera.follow(None)
        if self.objects is not None and self._takes is not None and self._calibration is not None:
            self._show_paused(any(actor.get("paused") for actor in status["actors"].values()))
            answer = self._ask(op="objects")
            self.objects.refresh(answer)
            self._calibration.refresh(answer["bodies"])
            self._takes.refresh()
            if self._hands is not None:
                self._hands.refresh(status)

    @staticmethod
    def _show_is_fresh(history: History, now_s: float) -> bool:
        return now_s - history.newest_s <= STALE_S

    def _headline_of(self, state: Verdict, history: History) -> str:
        if (shown := self._view.recording) is not None:
            return html.take_line(shown.name, shown.seconds)
        detail = state.detail
        if state.level != "bad" and self._show.live and history.rate_hz(time.monotonic()):
            latency = next(iter(self._show.live.values())).message.latency_ms
            processing = latency.total - latency.buffer
            processing_text = f"{processing:.1f}" if processing < 10.0 else f"{processing:.0f}"
            detail += f" · {latency.buffer:.0f} ms look-ahead + {processing_text} ms processing"
        return html.state_line(state, detail)

    def _controls(self, gui: viser.GuiApi) -> None:
        self._pause = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE, hint="keep the hands as they are")
        rest = gui.add_button(
            "Rest", icon=viser.Icon.HAND_STOP, hint="ease both hands to the rest pose and start again from there"
        )
        self._pause.on_click(lambda _: self.perform(self._toggle_pause))
        rest.on_click(lambda _: self.perform(self._rest))

    def _rest(self) -> None:
        self._ask(op="rest")

    def _toggle_pause(self) -> None:
        self._ask(op="pause", on=not self._paused)

    def _show_paused(self, paused: bool) -> None:
        if paused != self._paused:
            self._paused = paused
            self._pause.label = "Resume" if paused else "Pause"
            self._pause.icon = viser.Icon.PLAYER_PLAY if paused else viser.Icon.PLAYER_PAUSE


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


def _health(status: dict[str, Any]) -> str:
    rows = ["| | body | Hz | last seen |", "|---|---|--:|--:|"]
    hands = []
    for name, actor in status["actors"].items():
        whose = f"{escape(name)}: " if len(status["actors"]) > 1 else ""
        if whose:
            rows.append(f"| | **{escape(name)}** | | |")
        for body, health in actor["bodies"].items():
            carried = actor.get("objects", {}).get(body, body)
            label = escape(body) if carried == body else f"{escape(body)} ({escape(carried)})"
            rows.append(
                f"| {DOTS[health['state']]} | {label} | {health['rate_hz'] or 0.0:.0f} | {ago(health['age_s'])} |"
            )
        for side, hand in actor["hands"].items():
            hands.append(f"{whose}{side} hand **{hand['state']}**{_on(hand['object'], actor)}")
    return "\n".join(rows) + "\n\n" + "\n\n".join([*hands, refusals_text(status.get("drops", {}))])


def _on(body: str | None, actor: dict[str, Any]) -> str:
    """What a hand is at: its body, and the object that this carries if it has another name."""
    if body is None:
        return ""
    carried = actor.get("objects", {}).get(body, body)
    return f" on {escape(body)}" if carried == body else f" on {escape(body)} ({escape(carried)})"
