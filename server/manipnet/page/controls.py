"""What the panel and its tabs share: how they ask the server, run what a visitor clicked, and show what is reported."""

import time
from collections.abc import Callable, Coroutine
from typing import Any, Final

import viser

ANSWER_S: Final = 20.0
"""A browser that has not answered after this time is not waited for."""
SETTLE_S: Final = 1.0
"""For this time after a visitor has changed a field, what the server reports may be older than the field."""

Ask = Callable[..., dict[str, Any]]
"""Sends one control request, given as keyword arguments, and returns the answer. Raises `RefusedError`."""
Action = Callable[[], str | None]
"""What a click does; it returns a message for the visitor, if there is one."""
Perform = Callable[[Action], None]
"""Runs an action and notifies the visitor of its message or its error."""


def by_visitor(action: Callable[[], None]) -> Callable[[viser.GuiEvent[Any]], None]:
    """A callback for `on_update` that ignores the values this program sets itself. It runs on a thread and may wait."""

    def changed(event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            action()

    return changed


def at_once(action: Callable[[], None]) -> Callable[[viser.GuiEvent[Any]], Coroutine[Any, Any, None]]:
    """A callback like that of `by_visitor` for an action that only sets other controls and never waits.

    It runs before the visitor's next change is received, so it cannot overwrite that change.
    """

    async def changed(event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            action()

    return changed


class Fields:
    """Fields that show what the server reports, and that a visitor changes.

    A report that the server sent before the change reached it would put the old value back into the field, and the
    handler of the change could then read the old value.
    """

    def __init__(self, *fields: viser.GuiInputHandle[Any]) -> None:
        self._fields = fields
        self._written_s = {id(field): field.update_timestamp for field in fields}
        """When this program last wrote each field itself. Viser's handles are not hashable."""

    @property
    def settled(self) -> bool:
        """Whether the fields may be written: no visitor has changed one of them a moment ago."""
        now_s = time.time()
        return all(
            field.update_timestamp == self._written_s[id(field)] or now_s - field.update_timestamp > SETTLE_S
            for field in self._fields
        )

    def write(self, field: viser.GuiInputHandle[Any], value: Any) -> None:
        """Show a value in a field."""
        field.value = value
        self._written_s[id(field)] = field.update_timestamp


def remembered(client: viser.ClientHandle, key: str) -> str | None:
    """What a visitor's browser has kept under a key; waits for it. None if it kept nothing or does not answer."""
    try:
        return client.local_storage.get_item(key, ANSWER_S)
    except (RuntimeError, TimeoutError):  # he has left, or his browser stores nothing
        return None
