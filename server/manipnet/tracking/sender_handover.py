"""Which sender moves which body, and whose clock is the stream's, when several senders share one actor."""

from collections.abc import Iterable
from typing import Final

OTHER_SENDER_S: Final = 0.2
"""A body, and the clock, may pass to another sender once their own sender was silent for this long."""
CLOCK: Final = ""
"""Stands for the stream's clock among the names of bodies."""


class SenderHandover:
    """Lets one sender at a time move a body. Senders may share an actor if they share a clock and no body."""

    def __init__(self) -> None:
        self._owners: dict[str, tuple[str, float]] = {}

    def may_send(self, name: str, source: str, now_s: float) -> bool:
        """Whether `source` moves a body, or may take it over."""
        owner, heard_s = self._owners.get(name, (source, now_s))
        return owner == source or now_s - heard_s >= OTHER_SENDER_S

    def note(self, names: Iterable[str], source: str, now_s: float) -> None:
        """Note that `source` sent these bodies; it also keeps or takes the clock if it may."""
        for name in (CLOCK, *names):
            if self.may_send(name, source, now_s):
                self._owners[name] = (source, now_s)

    def clock_owner(self) -> str | None:
        """The sender whose clock is the stream's; None before the first frame."""
        return self._owners[CLOCK][0] if CLOCK in self._owners else None

    def forget(self, name: str) -> None:
        """Forget which sender moves a body."""
        self._owners.pop(name, None)

    def restart(self, names: Iterable[str], source: str, now_s: float) -> None:
        """Give the clock and these bodies to `source`, and forget all other owners."""
        self._owners = dict.fromkeys((CLOCK, *names), (source, now_s))
