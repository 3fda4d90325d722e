"""A session: the client reads on its own thread and never uses Blender, and a timer shows the hands."""

import time

import bpy
import numpy as np

from .manipnet_client import Client, Stats
from .manipnet_client.zmtp import parse_address
from .recording import Recording
from .rig import ArmatureHand, JointEmpties

SHOW_EVERY_S = 1.0 / 60.0
REDRAW_EVERY_S = 0.25
SIDES = ("left", "right")


class Session:
    """The connection and the hands that it drives. Only Blender's main thread may call the methods."""

    def __init__(self) -> None:
        self._client: Client | None = None
        self._hands: dict[str, ArmatureHand | JointEmpties] = {}
        self._recording: Recording | None = None
        self._armature: bpy.types.Object | None = None
        self._redrawn_s = 0.0

    @property
    def is_running(self) -> bool:
        """Whether the client is connected or tries to connect."""
        return self._client is not None

    @property
    def is_recording(self) -> bool:
        """Whether the shown motion is being recorded."""
        return self._recording is not None

    @property
    def can_record(self) -> bool:
        """Whether there is an armature that can have keyframes."""
        return self._armature is not None

    def stats(self) -> Stats:
        """The statistics that the panel shows."""
        return self._client.stats() if self._client else Stats(state="off")

    def start(self, address: str, actor: str, delay_s: float, armature: bpy.types.Object | None, wrists: bool) -> None:
        """Connect and show hands; raises `ValueError` for a wrong address and `RigError` for an unknown rig."""
        parse_address(address)
        self.stop()
        self._hands = {s: ArmatureHand(armature, s, wrists) if armature else JointEmpties(s) for s in SIDES}
        self._armature = armature
        self._client = Client(address, actor or None, delay_s)
        bpy.app.timers.register(self._tick, first_interval=0.0)

    def stop(self) -> None:
        """Disconnect, after writing the keyframes of a running recording."""
        if self._client is None:
            return
        self.stop_recording()
        client, self._client = self._client, None
        if bpy.app.timers.is_registered(self._tick):
            bpy.app.timers.unregister(self._tick)
        client.close()
        self._hands = {}
        self._armature = None

    def start_recording(self) -> None:
        """Record the shown motion from now on."""
        if self._armature:
            names = [name for hand in self._hands.values() for name in (*hand.bone_names, *hand.moved)]
            moved = [name for hand in self._hands.values() for name in hand.moved]
            self._recording = Recording(self._armature, names, moved)

    def stop_recording(self) -> int:
        """Write the keyframes from the scene's current frame on; returns the number of frames."""
        recording, self._recording = self._recording, None
        if recording is None:
            return 0
        scene = bpy.context.scene
        return recording.write(scene.frame_current, scene.render.fps / scene.render.fps_base)

    def _tick(self) -> float | None:
        """Show the hands of this moment, however slow Blender is; returns seconds until the next call, None to end."""
        if self._client is None:
            return None
        now_s = time.monotonic()
        shown = self._client.sample(now_s)
        if shown is not None:
            present = {side: hand for side in SIDES if (hand := shown.hands.hand(side)) is not None}
            for side, hand in present.items():
                self._hands[side].show(hand, shown.weight)
            if self._recording is not None and len(present) == len(SIDES):
                rotations, locations = zip(*(self._hands[side].keys(present[side]) for side in SIDES), strict=True)
                self._recording.add(now_s, np.concatenate(rotations), np.concatenate(locations))
        if now_s - self._redrawn_s > REDRAW_EVERY_S:
            self._redrawn_s = now_s
            self._redraw()
        return SHOW_EVERY_S

    def _redraw(self) -> None:
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "VIEW_3D":
                    area.tag_redraw()


session = Session()
