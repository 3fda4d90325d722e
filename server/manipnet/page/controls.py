"""What the panel and its tabs share: how they ask the server, and how they run what a visitor clicked."""

from collections.abc import Callable
from typing import Any

import viser

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
