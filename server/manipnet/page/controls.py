"""What the panel and its tabs share: how they ask the server, and how they run what a visitor clicked."""

from collections.abc import Callable
from typing import Any, Final

import viser

ANSWER_S: Final = 20.0
"""A browser that has not answered after this time is not waited for."""

Ask = Callable[..., dict[str, Any]]
"""Sends one control request, given as keyword arguments, and returns the answer. Raises `RefusedError`."""
Action = Callable[[], str | None]
"""What a click does; it returns a message for the visitor, if there is one."""
Perform = Callable[[Action], None]
"""Runs an action and notifies the visitor of its message or its error."""


def by_visitor(action: Callable[[], None]) -> Callable[[viser.GuiEvent[Any]], None]:
    """A callback for `on_update` that ignores the values this program sets itself."""

    def changed(event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            action()

    return changed


def remembered(client: viser.ClientHandle, key: str) -> str | None:
    """What a visitor's browser has kept under a key; waits for it. None if it kept nothing or does not answer."""
    try:
        return client.local_storage.get_item(key, ANSWER_S)
    except (RuntimeError, TimeoutError):  # he has left, or his browser stores nothing
        return None
