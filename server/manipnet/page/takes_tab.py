"""The tab that records takes and plays them back."""

import threading
import time
from pathlib import Path
from typing import Final

import viser

from manipnet.page.controls import Ask, Perform, by_visitor
from manipnet.page.markdown import escape
from manipnet.page.playback import read_recording
from manipnet.page.show import Show

PLAY_HZ: Final = 30.0
NONE: Final[str] = "none"


class TakesTab:
    """Records, shows a recording at any instant, and returns to the live session."""

    def __init__(self, ask: Ask, show: Show, gui: viser.GuiApi, perform: Perform) -> None:
        self._ask, self._show = ask, show
        self._folder, self._recording = Path(), False
        self._playing = threading.Event()
        self._record = gui.add_button("Record", icon=viser.Icon.PLAYER_RECORD, color="red")
        self._progress = gui.add_markdown("")
        gui.add_divider()
        self._take = gui.add_dropdown("Take", (NONE,))
        self._open = gui.add_button("Show this take", icon=viser.Icon.MOVIE)
        self._scrub = gui.add_slider("Time, s", 0.0, 1.0, 0.01, initial_value=0.0, visible=False)
        self._play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY, visible=False)
        self._live = gui.add_button("Back to live", icon=viser.Icon.BROADCAST, visible=False)
        self._record.on_click(lambda _: perform(self._toggle_record))
        self._open.on_click(lambda _: perform(self._show_take))
        self._play.on_click(lambda _: perform(self._toggle_play))
        self._live.on_click(lambda _: perform(self._back))
        self._scrub.on_update(by_visitor(lambda: show.seek(self._scrub.value)))

    def refresh(self) -> None:
        """Show the recording in progress and offer the takes in the folder."""
        answer = self._ask(op="recordings")
        self._folder = Path(answer["folder"])
        takes = tuple(answer["recordings"]) or (NONE,)
        if self._take.options != takes:
            self._take.options = takes
        now = answer["recording"]
        if (now is not None) != self._recording:
            self._recording = now is not None
            self._record.label = "Stop recording" if self._recording else "Record"
            self._record.icon = viser.Icon.PLAYER_STOP if self._recording else viser.Icon.PLAYER_RECORD
        recording = f"● **{escape(now['name'])}** · {now['seconds']:.0f} s" if now else ""
        self._progress.content = recording or f"Takes are saved in {escape(self._folder)}"

    def _toggle_record(self) -> str | None:
        if not self._recording:
            self._ask(op="record")
            return None
        answer = self._ask(op="stop_recording")
        return f"{answer['name']}: {answer['hands']} hands messages, {answer['bodies']} body frames"

    def _show_take(self) -> None:
        if self._take.value == NONE:
            raise ValueError("there is no take yet; press Record")
        recording = read_recording(self._folder / self._take.value)
        self._pause()
        self._show.play(recording)
        self._scrub.max, self._scrub.value = max(round(recording.seconds, 2), 0.01), 0.0
        self._scrub.visible = self._play.visible = self._live.visible = True

    def _back(self) -> None:
        self._pause()
        self._show.play(None)
        self._scrub.visible = self._play.visible = self._live.visible = False

    def _toggle_play(self) -> None:
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
        """Play from the position of the slider, again and again."""
        while self._playing.is_set():
            self._scrub.value = (self._scrub.value + 1.0 / PLAY_HZ) % self._scrub.max
            self._show.seek(self._scrub.value)
            time.sleep(1.0 / PLAY_HZ)
