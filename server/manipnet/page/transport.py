"""The controls that are always visible: recording, and the playback of the take that this visitor watches."""

import threading
import time
from typing import Any, Final

import viser

from manipnet.page.controls import Ask, Perform, by_visitor
from manipnet.page.html import clock
from manipnet.page.playback import Recording
from manipnet.page.take_view import TakeView

PLAY_HZ: Final = 30.0
STEP_S: Final = 1.0 / 60.0
"""What an arrow key moves a take by: one tick."""
MARK: Final = '<div class="mn-big" data-visitor="{visitor}"></div>'
"""An empty element by which the style sheet finds the button that follows it, and the script whose page it is."""


class Transport:
    """Record, and play, step through and leave a take. `R` records, space plays, arrows step."""

    def __init__(self, ask: Ask, client: viser.ClientHandle, view: TakeView, perform: Perform, operator: bool) -> None:
        self._ask, self._view, self._perform = ask, view, perform
        self._playing = threading.Event()
        self._recording: dict[str, Any] | None = None
        self.about: dict[str, Any] = {}
        """What the next recording is called: some of `name`, `slate`, `number` and `note`."""
        gui = client.gui
        if operator:
            gui.add_html(MARK.format(visitor=client.client_id))
            self._record = gui.add_button("Record", icon=viser.Icon.PLAYER_RECORD, color="red", hint="key R")
            self._record.on_click(lambda _: perform(self._toggle_record))
            self._key(gui, "Record", "R", self._toggle_record)
        self._operator = operator
        self._scrub = gui.add_slider("Time, s", 0.0, 1.0, 0.01, initial_value=0.0, visible=False)
        self._play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY, visible=False, hint="space; arrows step")
        self._live = gui.add_button("Back to live", icon=viser.Icon.BROADCAST, visible=False, color="green")
        self._play.on_click(lambda _: perform(self._toggle_play))
        self._live.on_click(lambda _: perform(self.back))
        self._scrub.on_update(by_visitor(self._scrubbed))
        self._key(gui, "Play or pause the take", "space", self._toggle_play)
        self._key(gui, "One frame back", "arrowleft", lambda: self._step(-1))
        self._key(gui, "One frame on", "arrowright", lambda: self._step(1))

    @property
    def recording(self) -> dict[str, Any] | None:
        """The recording in progress: its `name` and its `seconds`."""
        return self._recording

    def refresh(self, now: dict[str, Any] | None) -> None:
        """Show the recording that is in progress, as the server reports it."""
        before, self._recording = self._recording, now
        if not self._operator:
            return
        self._record.label = "Record" if now is None else f"Stop recording {clock(now['seconds'])}"
        if (now is None) != (before is None):
            self._record.icon = viser.Icon.PLAYER_RECORD if now is None else viser.Icon.PLAYER_STOP

    def show(self, recording: Recording) -> None:
        """Show a take to this visitor."""
        self._pause()
        self._view.open(recording)
        self._scrub.max, self._scrub.value = max(round(recording.seconds, 2), 0.01), 0.0
        self._show_controls(True)

    def back(self) -> None:
        """Return this visitor to the live session."""
        self._pause()
        self._view.close()
        self._show_controls(False)

    def close(self) -> None:
        """Stop playing: the visitor has left."""
        self._playing.clear()

    def toggle_record(self) -> str | None:
        """Begin a recording, or end the one in progress; returns a message."""
        return self._toggle_record()

    def _toggle_record(self) -> str | None:
        if self._ask(op="recordings")["recording"] is None:
            self._ask(op="record", **self.about)
            if "number" in self.about:
                self.about = {**self.about, "number": self.about["number"] + 1}
            return None
        answer = self._ask(op="stop_recording")
        return f"{answer['name']}: {answer['hands']} hands messages, {answer['bodies']} body frames"

    def _show_controls(self, visible: bool) -> None:
        self._scrub.visible = self._play.visible = self._live.visible = visible

    def _scrubbed(self) -> None:
        self._view.seek(self._scrub.value)

    def _step(self, frames: int) -> None:
        if self._view.recording is not None:
            self._pause()
            self._scrub.value = min(max(self._scrub.value + frames * STEP_S, 0.0), self._scrub.max)
            self._view.seek(self._scrub.value)

    def _toggle_play(self) -> None:
        if self._view.recording is None:
            return
        if self._playing.is_set():
            self._pause()
            return
        self._playing.set()
        self._play.label, self._play.icon = "Pause playback", viser.Icon.PLAYER_PAUSE
        threading.Thread(target=self._run, name="playback", daemon=True).start()

    def _pause(self) -> None:
        self._playing.clear()
        self._play.label, self._play.icon = "Play", viser.Icon.PLAYER_PLAY

    def _run(self) -> None:
        """Play in real time from the position of the slider, again and again."""
        shown_s = time.monotonic()
        while self._playing.is_set():
            now_s = time.monotonic()
            self._scrub.value = (self._scrub.value + now_s - shown_s) % self._scrub.max
            shown_s = now_s
            self._view.seek(self._scrub.value)
            time.sleep(max(now_s + 1.0 / PLAY_HZ - time.monotonic(), 0.0))

    def _key(self, gui: viser.GuiApi, label: str, key: Any, action: Any) -> None:
        gui.add_command(label, hotkey=key).on_trigger(lambda _: self._perform(action))
