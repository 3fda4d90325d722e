"""The actors, for threads other than the one that owns them."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from manipnet.actors.actor import Actor
from manipnet.control.request import Request, RequestError, choice
from manipnet.runtime.mailbox import BusyError, Mailbox

T = TypeVar("T")


class ActorsProxy:
    """The actors of a server as other threads may have them: between two ticks."""

    def __init__(self, actors: Sequence[Actor], mailbox: Mailbox) -> None:
        self.actors, self._mailbox = actors, mailbox

    def actor(self, request: Request) -> Actor:
        """Whom a request is about, the first unless it says; raises `RequestError`."""
        names = tuple(actor.config.name for actor in self.actors)
        return self.actors[names.index(choice(request, "actor", names, default=names[0]))]

    def ask(self, question: Callable[[], T]) -> T:
        """The answer of the tick thread; raises `RequestError` for a `ValueError`, and when there is none."""
        try:
            return self._mailbox.ask(question)
        except (BusyError, ValueError) as error:
            raise RequestError(str(error)) from None


def body_key(request: Request) -> int | str:
    """The `body` of a request; raises `RequestError`."""
    body = request.get("body")
    if isinstance(body, bool) or not isinstance(body, int | str) or not 0 < len(str(body)) <= 128:
        raise RequestError("body is missing or no name; give the streaming id or name of a body")
    return body
