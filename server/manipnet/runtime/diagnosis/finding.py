"""One line of a diagnosis."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final, Literal

Level = Literal["ok", "note", "problem"]
Report = Mapping[str, Any]
"""What `status` reports about reception; the doctor makes the same of what it hears itself."""
RECENT_S: Final = 10.0
"""What happened longer ago is history: a note."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One line for a person. A problem has a remedy."""

    level: Level
    text: str
    remedy: str = ""

    def as_map(self) -> dict[str, str]:
        """The finding as plain data."""
        return asdict(self)


def of_map(entry: Mapping[str, Any]) -> Finding:
    """The inverse of `Finding.as_map`."""
    return Finding(entry["level"], str(entry["text"]), str(entry.get("remedy", "")))


def ago(age_s: float) -> str:
    """An age in words."""
    return f"{1e3 * age_s:.0f} ms ago" if age_s < 1.0 else f"{age_s:.0f} s ago"


def listed(names: list[str], most: int = 12) -> str:
    """Some names, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def label(body: Mapping[str, Any]) -> str:
    """A body as its sender calls it."""
    if body["id"] is None:
        return repr(body["name"])
    return str(body["id"]) if body["name"] is None else f"{body['id']} {body['name']!r}"
