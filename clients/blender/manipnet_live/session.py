"""A session: clients read on their own threads and never use Blender, and a timer shows the hands."""

from __future__ import annotations

import time
from collections.abc import Sequence

import bpy

from .character import Cast, Character
from .manipnet_client import Stats
from .manipnet_client.zmtp import parse_address
from .props import Props
from .recording import Bake, Recording, Track
from .remote import Remote
from .timecode import timecode_frames

SHOW_EVERY_S = 1.0 / 60.0
REDRAW_EVERY_S = 0.25
CONTROL = "tcp://127.0.0.1:5557"


class Session:
    """The connections and the characters that they drive. Only Blender's main thread may call the methods."""

    def __init__(self) -> None:
        self.characters: list[Character] = []
        self.problem = ""
        """Why the last session ended, if an error ended it."""
        self.remote: Remote | None = None
        """Sends requests to the server while the clients are connected."""
        self._props: Props | None = None
        self._recording: Recording | None = None
        self._prop_tracks: list[Track] = []
        self._redrawn_s = 0.0

    @property
    def is_running(self) -> bool:
        """Whether the clients are connected or try to connect."""
        return bool(self.characters)

    @property
    def is_recording(self) -> bool:
        """Whether the shown motion is being recorded."""
        return self._recording is not None

    @property
    def can_record(self) -> bool:
        """Whether there is an armature, or a prop, that can have keyframes."""
        return self.is_running and (self._props is not None or any(each.can_record for each in self.characters))

    @property
    def problems(self) -> list[str]:
        """What the user should know: missing bones, hands that do not reach their wrists, meshes that do not arrive."""
        out = [self.problem] if self.problem else []
        for character in self.characters:
            out += character.problems
            far = {side: far_m for side, far_m in character.distances_m().items() if far_m > 0.02}
            out += [f"The {side} hand is {100 * far_m:.0f} cm from its wrist" for side, far_m in far.items()]
        return out + ([self._props.problem] if self._props and self._props.problem else [])

    def stats(self) -> Stats:
        """The statistics of the first character."""
        return self.characters[0].stats() if self.characters else Stats(state="off")

    def start(
        self, address: str, delay_s: float, cast: Sequence[Cast], control_address: str = CONTROL, props: bool = False
    ) -> None:
        """Connect and show the cast, and the tracked bodies with their meshes if `props` are wanted.

        Raises `ValueError` for a wrong address and `RigError` for an unknown rig. Then nothing has been started.
        """
        parse_address(address)
        self.stop()
        self.problem = ""
        started: list[Character] = []
        try:
            for each in cast or (Cast(),):
                started.append(Character(address, control_address, delay_s, each))
            self._props = Props(control_address) if props else None
            self.remote = Remote(control_address)
        except ValueError:
            for character in started:
                character.close()
            raise
        self.characters = started
        bpy.app.timers.register(self._tick, first_interval=0.0, persistent=True)

    def stop(self) -> int:
        """Disconnect, after making the keyframes of a running recording; returns their number of frames."""
        recording = self._recording
        self._end()
        return self._write(recording, "CURRENT", False, 0.0) if recording else 0

    def stop_for_another_file(self) -> Recording | None:
        """Disconnect before Blender opens another file; returns the running recording, which no file has yet."""
        recording = self._recording
        self._end()
        return recording

    def release(self) -> None:
        """Remove what is in the scene only while the session runs, before it is saved; the next tick makes it again."""
        for character in self.characters:
            character.release()

    def start_recording(self) -> None:
        """Record the shown motion from now on."""
        if not self.can_record:
            return
        self._recording = Recording({})
        for character in self.characters:
            self._recording.tracks += character.start_recording()
        self._prop_tracks = self._props.new_tracks() if self._props else []
        self._recording.tracks += self._prop_tracks

    def stop_recording(
        self, start_at: str = "CURRENT", within_scene: bool = False, keys_per_second: float = 0.0
    ) -> int:
        """Make the keyframes; returns the number of frames.

        They begin at the scene's "CURRENT" frame, at its first frame ("SCENE"), or at the frame of the tracker's
        "TIMECODE". `within_scene` leaves out what comes after the scene's end, which is moved otherwise. There is one
        key for each frame if `keys_per_second` is 0.
        """
        recording = self._recording
        self._stop_recording()
        return self._write(recording, start_at, within_scene, keys_per_second) if recording else 0

    def write_kept(self, recording: Recording) -> int:
        """Make actions, without their objects, from a recording that ended because another file was opened."""
        scene = bpy.context.scene
        return recording.write(Bake(scene.frame_current, scene.render.fps / scene.render.fps_base, 0.0), attach=False)

    def _write(self, recording: Recording, start_at: str, within_scene: bool, keys_per_second: float) -> int:
        scene = bpy.context.scene
        fps = scene.render.fps / scene.render.fps_base
        first = float({"SCENE": scene.frame_start}.get(start_at, scene.frame_current))
        timecode, rate_hz = recording.labels.get("timecode"), recording.labels.get("timecode_rate", fps)
        if start_at == "TIMECODE" and timecode is not None:
            first = timecode_frames(str(timecode), float(rate_hz)) / float(rate_hz) * fps
        frames = recording.write(Bake(first, fps, keys_per_second, scene.frame_end if within_scene else None))
        if frames and not within_scene:
            scene.frame_end = max(scene.frame_end, int(first) + frames - 1)
        return frames

    def _end(self) -> None:
        self._stop_recording()
        characters, self.characters = self.characters, []
        props, self._props = self._props, None
        remote, self.remote = self.remote, None
        if bpy.app.timers.is_registered(self._tick):
            bpy.app.timers.unregister(self._tick)
        for character in characters:
            character.close()
        if props is not None:
            props.close()
        if remote is not None:
            remote.close()

    def _stop_recording(self) -> None:
        self._recording, self._prop_tracks = None, []
        for character in self.characters:
            character.stop_recording()

    def _tick(self) -> float | None:
        """Show the hands of this moment; returns seconds until the next call, None to end."""
        if not self.characters:
            return None
        now_s = time.monotonic()
        try:
            self._show(now_s)
        except ReferenceError:
            pass  # Blender replaced its data between two lines, as undo does; the next tick finds it again
        except Exception as error:
            # An error would end the timer without a word; what was recorded until now is kept.
            self.problem = f"Disconnected by an error: {type(error).__name__}: {error}"
            self.stop()
            raise
        if now_s - self._redrawn_s > REDRAW_EVERY_S:
            self._redrawn_s = now_s
            self._redraw()
        return SHOW_EVERY_S

    def _show(self, now_s: float) -> None:
        for character in self.characters:
            character.show(now_s)
            if self._props is not None and character.shown is not None:
                self._props.show(character.shown.bodies)
        if self._recording is not None:
            bpy.context.view_layer.update()  # constraints must have moved the arms before their poses are recorded
            self._note_timecode(self._recording)
            for character in self.characters:
                character.record(now_s)
            if self._props is not None:
                self._props.record(self._prop_tracks, now_s)

    def _note_timecode(self, recording: Recording) -> None:
        shown = self.characters[0].shown
        if shown is None or shown.timecode is None or "timecode" in recording.labels:
            return
        if any(len(track) for track in recording.tracks):
            return  # the first instant had no timecode, and a later one would move the take
        recording.labels["timecode"] = shown.timecode
        if shown.timecode_rate is not None:
            recording.labels["timecode_rate"] = shown.timecode_rate

    def _redraw(self) -> None:
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "VIEW_3D":
                    area.tag_redraw()


session = Session()
