"""The request `hand_profile`: a client uploads the hands of its avatar, and subscribes to their topics."""

from collections.abc import Mapping
from typing import Any

from manipnet.actors.avatar import Avatar
from manipnet.control.actors_proxy import ActorsProxy
from manipnet.control.request import Handler, Request, RequestError, choice
from manipnet.runtime.avatars import FORGET_AFTER_S, Avatars, TooManyProfilesError
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.profile import ProfileError, parse_profile
from manipnet.wire import hand_topics

_OWN_KEYS = ("op", "actor", "profile")


class HandRequests:
    """Requests about avatars. Profiles are read on the control thread; the tick thread only takes the result."""

    def __init__(self, proxy: ActorsProxy, avatars: Avatars, model: Hand) -> None:
        self._proxy, self._avatars, self._model = proxy, avatars, model

    def handlers(self) -> Mapping[str, Handler]:
        """One function per operation."""
        return {"hand_profile": self._hand_profile}

    def _hand_profile(self, request: Request) -> dict[str, Any]:
        names = tuple(actor.config.name for actor in self._proxy.actors)
        actor = choice(request, "actor", names, names[0])
        content = request.get("profile") or {key: value for key, value in request.items() if key not in _OWN_KEYS}
        try:
            avatar = Avatar(parse_profile(content), self._model)
            self._proxy.ask(lambda: self._avatars.add(avatar, actor))
        except (ProfileError, TooManyProfilesError) as error:
            raise RequestError(str(error)) from None
        name = avatar.profile.name
        return {
            "name": name,
            "actor": actor,
            "topics": [topic.decode().rstrip() for topic in hand_topics(name)],
            "guessed": avatar.guessed,
            "forgotten_after_s": FORGET_AFTER_S,
        }
