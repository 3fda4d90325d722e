"""One actor of the stream, shown on an armature or as empties, and recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import bpy

from .bones import SIDES, RigError
from .manipnet_client import Client, ControlClient, Hands, HandUpload, Stats
from .manipnet_client.avatar import avatar_profile
from .recording import Track
from .rig import ArmatureHand, JointEmpties

TIMEOUT_S = 2.0


@dataclass(frozen=True)
class Cast:
    """What shows one actor: the name of the `actor` (the first one received, if empty), and an armature or empties."""

    actor: str = ""
    armature: bpy.types.Object | None = None
    follow_wrists: bool = False
    bone_map: Mapping[str, str] | None = None
    solve_on_avatar: bool = False
    """Whether the server solves contact on the hands of the armature."""


class Character:
    """The connection for one actor and the hands that it drives. Only Blender's main thread may call the methods."""

    def __init__(self, address: str, control_address: str, delay_s: float, cast: Cast) -> None:
        """Raises `ValueError` for a wrong address and `RigError` if the armature has neither hand."""
        self._rig_problems: list[str] = []
        self._hands: dict[str, ArmatureHand | JointEmpties] = self._make_hands(cast)
        self._tracks: dict[str, Track] = {}
        self.shown: Hands | None = None
        """The hands that were shown last."""
        self._client, self._upload = self._connect(address, control_address, delay_s, cast)

    @property
    def problems(self) -> list[str]:
        """What the user should know: missing bones, and why the server does not solve on the avatar."""
        return self._rig_problems + ([self._upload.problem] if self._upload and self._upload.problem else [])

    @property
    def can_record(self) -> bool:
        """Whether there is an armature that can have keyframes."""
        return bool(self._armature_hands())

    def stats(self) -> Stats:
        """The statistics of the connection."""
        return self._client.stats()

    def distances_m(self) -> dict[str, float]:
        """How far each hand that follows its wrist is from it, by side."""
        return {side: hand.distance_m for side, hand in self._armature_hands().items()}

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
        self._tracks = {side: hand.new_track() for side, hand in self._armature_hands().items()}
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
        for hand in self._armature_hands().values():
            hand.release()

    def close(self) -> None:
        """Disconnect, and leave the armature as it is."""
        if self._upload is not None:
            self._upload.close()
        self._client.close()
        self.release()

    def _connect(
        self, address: str, control_address: str, delay_s: float, cast: Cast
    ) -> tuple[Client, HandUpload | None]:
        avatars = {side: hand.avatar for side, hand in self._armature_hands().items() if hand.avatar is not None}
        actor = cast.actor or None
        if cast.armature is None or not avatars:
            return Client(address, actor, delay_s), None
        control = ControlClient(control_address, timeout_s=TIMEOUT_S)
        profile = avatar_profile(cast.armature.name, avatars, cast.actor)
        client = Client(address, actor, delay_s, hand=profile["name"])
        return client, HandUpload(control, profile, lambda: client.stats().age_s, actor)

    def _armature_hands(self) -> dict[str, ArmatureHand]:
        return {side: hand for side, hand in self._hands.items() if isinstance(hand, ArmatureHand)}

    def _make_hands(self, cast: Cast) -> dict[str, ArmatureHand | JointEmpties]:
        if cast.armature is None:
            return {side: JointEmpties(side, cast.actor) for side in SIDES}
        hands: dict[str, ArmatureHand | JointEmpties] = {}
        for side in SIDES:
            try:
                bone_map = cast.bone_map or {}
                hand = ArmatureHand(cast.armature, side, cast.follow_wrists, bone_map, cast.solve_on_avatar)
            except RigError as error:
                self._rig_problems.append(str(error))
                continue
            hands[side] = hand
            if hand.bones.missing:
                missing = ", ".join(hand.bones.missing)
                self._rig_problems.append(f"{cast.armature.name} has no bone for {missing} of the {side} hand")
        if not hands:
            raise RigError("; ".join(self._rig_problems))
        return hands
