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
        return not self.refused((name,), source, now_s)

    def refused(self, names: Iterable[str], source: str, now_s: float) -> list[str]:
        """Those of the names that `source` may not move."""
        return [
            name
            for name in names
            if (owned := self._owners.get(name)) is not None
            and owned[0] != source
            and now_s - owned[1] < OTHER_SENDER_S
        ]

    def note(self, names: Iterable[str], source: str, now_s: float) -> None:
        """Note that `source` sent these bodies, which it may; it also keeps or takes the clock if it may."""
        heard = source, now_s
        if self.may_send(CLOCK, source, now_s):
            self._owners[CLOCK] = heard
        for name in names:
            self._owners[name] = heard

    def clock_owner(self) -> str | None:
        """The sender whose clock is the stream's; None before the first frame."""
        return self._owners[CLOCK][0] if CLOCK in self._owners else None

    def forget(self, name: str) -> None:
        """Forget which sender moves a body."""
        self._owners.pop(name, None)

    def restart(self, names: Iterable[str], source: str, now_s: float) -> None:
        """Give the clock and these bodies to `source`, and forget all other owners."""
        self._owners = dict.fromkeys((CLOCK, *names), (source, now_s))
