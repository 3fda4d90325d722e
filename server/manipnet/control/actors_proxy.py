"""The actors, for threads other than the tick thread, which owns them."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from manipnet.actors.actor import Actor
from manipnet.control.request import Request, RequestError, choice
from manipnet.runtime.mailbox import BusyError, Mailbox

T = TypeVar("T")


class ActorsProxy:
    """Lets other threads use the actors of a server between two ticks."""

    def __init__(self, actors: Sequence[Actor], mailbox: Mailbox) -> None:
        self.actors, self._mailbox = actors, mailbox

    def actor(self, request: Request) -> Actor:
        """The actor that is named in the request; the first by default. Raises `RequestError`."""
        names = tuple(actor.config.name for actor in self.actors)
        return self.actors[names.index(choice(request, "actor", names, default=names[0]))]

    def named_or_all(self, request: Request) -> Sequence[Actor]:
        """The actor that is named in the request; all actors by default. Raises `RequestError`."""
        return self.actors if request.get("actor") is None else [self.actor(request)]

    def ask(self, question: Callable[[], T]) -> T:
        """Run `question` on the tick thread and return its answer.

        Raises `RequestError` for a `ValueError` of the question, and if the tick thread does not answer in time.
        """
        try:
            return self._mailbox.ask(question)
        except (BusyError, ValueError) as error:
            raise RequestError(str(error)) from None
