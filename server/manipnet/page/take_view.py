"""A take in the scene of one visitor, who does not see the live session meanwhile. Nobody else notices."""

import threading
from typing import Final

import viser

from manipnet.page.actor_view import Stage
from manipnet.page.framing import FollowCamera, focus_of
from manipnet.page.hand_look import HandLook
from manipnet.page.playback import Recording
from manipnet.page.show import LIVE

TAKE: Final = "/take"


class TakeView:
    """Shows an instant of a recording to one visitor."""

    def __init__(self, client: viser.ClientHandle, look: HandLook, camera: FollowCamera) -> None:
        self._client, self._look, self._camera = client, look, camera
        self._stage: Stage | None = None
        self._stages: dict[str, Stage] = {}
        """The stage of the takes of each actor, which is hidden and never removed: viser's client 1.1.1 fails when a
        whole tree is removed."""
        self._live: viser.FrameHandle | None = None
        """The visitor's own node above the live session. It is hidden and never removed: the browser would remove the
        live session with it."""
        self._drawing = threading.Lock()
        self.recording: Recording | None = None
        """The recording that is shown instead of the live session."""

    def open(self, recording: Recording) -> None:
        """Show a recording, and hide the live session from this visitor."""
        self.close()
        scene = self._client.scene
        with self._drawing, self._client.atomic():
            if self._live is None:
                self._live = scene.add_frame(LIVE, show_axes=False, visible=False)
            self._live.visible = False
            actor = recording.messages[0].actor
            if actor not in self._stages:
                self._stages[actor] = Stage(scene, f"{TAKE}/{len(self._stages)}", self._look)
            self._stage, self.recording = self._stages[actor], recording
            self._stage.settle()
            self._stage.set_visible(True)
        self._camera.restart()
        self.seek(0.0)

    def seek(self, second: float) -> None:
        """Show the open recording at this many seconds from its beginning."""
        with self._drawing, self._client.atomic():
            if self.recording is None or self._stage is None:
                return
            frame = self.recording.at(second)
            self._stage.show(frame, self.recording.shapes)
        self._camera.follow(focus_of([frame]))

    def close(self) -> None:
        """Return this visitor to the live session."""
        with self._drawing, self._client.atomic():
            if self.recording is None or self._stage is None:
                return
            if self._live is not None:
                self._live.visible = True
            self._stage.set_visible(False)
            self._stage = self.recording = None
        self._camera.restart()
