"""One actor of the stream, shown on an armature or as empties, and recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import bpy

from .bones import SIDES, RigError
from .manipnet_client import Client, Hands, Stats
from .recording import Track
from .rig import ArmatureHand, JointEmpties


@dataclass(frozen=True)
class Cast:
    """What shows one actor: the name of the `actor` (the first one received, if empty), and an armature or empties."""

    actor: str = ""
    armature: bpy.types.Object | None = None
    follow_wrists: bool = False
    bone_map: Mapping[str, str] | None = None


class Character:
    """The connection for one actor and the hands that it drives. Only Blender's main thread may call the methods."""

    def __init__(self, address: str, delay_s: float, cast: Cast) -> None:
        """Raises `ValueError` for a wrong address and `RigError` if the armature has neither hand."""
        self.problems: list[str] = []
        self._hands: dict[str, ArmatureHand | JointEmpties] = self._make_hands(cast)
        self._tracks: dict[str, Track] = {}
        self.shown: Hands | None = None
        """The hands that were shown last."""
        self._client = Client(address, cast.actor or None, delay_s)

    @property
    def can_record(self) -> bool:
        """Whether there is an armature that can have keyframes."""
        return any(isinstance(hand, ArmatureHand) for hand in self._hands.values())

    def stats(self) -> Stats:
        """The statistics of the connection."""
        return self._client.stats()

    def distances_m(self) -> dict[str, float]:
        """How far each hand that follows its wrist is from it, by side."""
        armatures = {side: hand for side, hand in self._hands.items() if isinstance(hand, ArmatureHand)}
        return {side: hand.distance_m for side, hand in armatures.items()}

    def show(self, now_s: float) -> None:
        """Show the hands of this moment, however slow Blender is."""
        shown = self._client.sample(now_s)
        self.shown = shown.hands if shown else None
        for side in SIDES:
            hand = shown.hands.hand(side) if shown else None
            if shown is not None and hand is not None and side in self._hands:
                self._hands[side].show(hand, shown.weight)

    def start_recording(self) -> list[Track]:
        """Record the shown motion from now on, into these tracks."""
        armatures = {side: hand for side, hand in self._hands.items() if isinstance(hand, ArmatureHand)}
        self._tracks = {side: hand.new_track() for side, hand in armatures.items()}
        return list(self._tracks.values())

    def record(self, now_s: float) -> None:
        """Add the poses of the hands that are shown now to the tracks. Blender has computed these poses."""
        for side, track in self._tracks.items():
            hand = self._hands[side]
            if self.shown is not None and self.shown.hand(side) is not None and isinstance(hand, ArmatureHand):
                hand.record(track, now_s)

    def stop_recording(self) -> None:
        """Add nothing more to the tracks."""
        self._tracks = {}

    def release(self) -> None:
        """Remove what is in the armature only while the hands are shown; the next `show` makes it again."""
        for hand in self._hands.values():
            if isinstance(hand, ArmatureHand):
                hand.release()

    def close(self) -> None:
        """Disconnect, and leave the armature as it is."""
        self._client.close()
        self.release()

    def _make_hands(self, cast: Cast) -> dict[str, ArmatureHand | JointEmpties]:
        if cast.armature is None:
            return {side: JointEmpties(side, cast.actor) for side in SIDES}
        hands: dict[str, ArmatureHand | JointEmpties] = {}
        for side in SIDES:
            try:
                hand = ArmatureHand(cast.armature, side, cast.follow_wrists, cast.bone_map or {})
            except RigError as error:
                self.problems.append(str(error))
                continue
            hands[side] = hand
            if hand.bones.missing:
                missing = ", ".join(hand.bones.missing)
                self.problems.append(f"{cast.armature.name} has no bone for {missing} of the {side} hand")
        if not hands:
            raise RigError("; ".join(self.problems))
        return hands
