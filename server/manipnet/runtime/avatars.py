"""The avatars of a server: hand profiles that clients upload or the rig names, and the hands solved on them."""

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Protocol

from manipnet.actors.actor import Actor
from manipnet.actors.avatar import Avatar
from manipnet.actors.transitions import ShownHand
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.telemetry import Telemetry
from manipnet.tracking.tick import Tick
from manipnet.wire import HandsMessage, Side

MAX_PROFILES: Final = 16
FORGET_AFTER_S: Final = 60.0
"""An uploaded profile that nobody has subscribed to for this long is forgotten."""
_log = logging.getLogger(__name__)


class AvatarAudience(Protocol):
    """Sends the hands of avatars, and knows who has subscribed to them."""

    def wants(self, avatar: str) -> bool: ...

    def publish_avatar(self, message: HandsMessage, profile: HandProfile) -> None: ...


class TooManyProfilesError(ValueError):
    """There is no room for another profile; the text says what to do."""


@dataclass
class _Entry:
    avatar: Avatar
    stays: bool
    """Whether it was given at the start of the server, and is never forgotten."""
    wanted_s: float
    """When somebody was subscribed to it, or uploaded it, for the last time."""


class Avatars:
    """Belongs to the tick thread."""

    def __init__(self, telemetry: Telemetry, clock: Callable[[], float] = time.monotonic) -> None:
        self._telemetry, self._clock = telemetry, clock
        self._entries: dict[tuple[str, str], _Entry] = {}
        """By the name of the profile and of the actor: one avatar may follow several actors."""
        self.audience: AvatarAudience | None = None

    def add(self, avatar: Avatar, actor: str, stays: bool = False) -> None:
        """Let an avatar follow an actor, in place of one of the same name. Raises `TooManyProfilesError`."""
        key, now_s = (avatar.profile.name, actor), self._clock()
        before = self._entries.get(key)
        if before is None and len(self._entries) >= MAX_PROFILES:
            raise TooManyProfilesError(
                f"the server already has {MAX_PROFILES} hand profiles, and no more are allowed "
                f"({', '.join(name for name, _ in self._entries)}); one is forgotten {FORGET_AFTER_S:.0f} s after its "
                "last subscriber has left"
            )
        self._entries[key] = _Entry(avatar, stays or (before is not None and before.stays), now_s)

    def names(self) -> list[tuple[str, str]]:
        """The name of each profile, with the name of the actor that its avatar follows."""
        return list(self._entries)

    def profiles(self) -> list[HandProfile]:
        """The profiles of all avatars."""
        return [entry.avatar.profile for entry in self._entries.values()]

    def show(self, actor: Actor, tick: Tick, hands: Mapping[Side, ShownHand], message: HandsMessage) -> None:
        """Publish the hands of the actor's avatars to which somebody has subscribed, for a tick just published."""
        for (name, follows), entry in self._entries.items():
            if follows == actor.config.name and self._is_wanted(name, entry):
                self._publish(entry.avatar, actor, tick, hands, message)

    def forget_unwanted(self) -> None:
        """Forget profiles to which nobody has subscribed for a while."""
        now_s = self._clock()
        for key, entry in list(self._entries.items()):
            if not entry.stays and not self._is_wanted(key[0], entry) and now_s - entry.wanted_s > FORGET_AFTER_S:
                del self._entries[key]

    def _is_wanted(self, name: str, entry: _Entry) -> bool:
        wanted = self.audience is not None and self.audience.wants(name)
        if wanted:
            entry.wanted_s = self._clock()
        return wanted

    def _publish(
        self, avatar: Avatar, actor: Actor, tick: Tick, hands: Mapping[Side, ShownHand], message: HandsMessage
    ) -> None:
        assert self.audience is not None
        try:
            poses = avatar.poses(actor, tick, hands)
            shown = replace(message, hands=poses, hand=avatar.profile.name, t_publish=self._clock())
            self.audience.publish_avatar(shown, avatar.profile)
        except Exception as error:
            self._telemetry.count("tick_errors", stage="avatar")
            _log.error("hand profile %s failed: %s: %s", avatar.profile.name, type(error).__name__, error)
            avatar.restart()


def avatars_of(actors: Sequence[Actor], profiles: Mapping[str, Avatar], telemetry: Telemetry) -> Avatars:
    """The avatars that the rig names, `profiles` by actor, which stay."""
    avatars = Avatars(telemetry)
    for actor in actors:
        if actor.config.name in profiles:
            avatars.add(profiles[actor.config.name], actor.config.name, stays=True)
    return avatars
