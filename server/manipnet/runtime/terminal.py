"""A terminal with one status line at its bottom, which is rewritten in place; other lines scroll past above it."""

import shutil
from collections.abc import Iterable
from typing import Final, TextIO
from unicodedata import combining, east_asian_width

WIDTH: Final = 80
"""The longest status line, in columns, on however wide a terminal."""
FIRST: Final = ("page", "bodies", "osc", "natnet", "hands", "web", "control")
"""The order of the most important addresses in the table."""
HINTS: Final = {
    "page": "open this in a browser",
    "bodies": "trackers send here (ZeroMQ)",
    "osc": "trackers send here (OSC)",
    "natnet": "OptiTrack Motive",
    "hands": "clients receive here (ZeroMQ)",
    "web": "browsers receive here (WebSocket)",
    "control": "`--server` of the other commands",
    "trigger": "starts and stops recordings (Motive)",
}


class Terminal:
    """Writes lines and a status line to a terminal. Belongs to one thread."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._status = ""

    def line(self, text: str) -> None:
        """Write a line above the status line."""
        self._write(f"{text}\n{self._status}")

    def status(self, text: str) -> None:
        """Replace the status line; an empty text leaves none."""
        room = min(shutil.get_terminal_size((WIDTH, 24)).columns, WIDTH) - 1  # a full line would wrap
        text = _cut(text, room)
        self._write(text)
        self._status = text

    def _write(self, text: str) -> None:
        """Write a text in place of the status line."""
        erased = f"\r{' ' * _columns(self._status)}\r" if self._status else ""
        self._stream.write(erased + text)
        self._stream.flush()


def _cut(text: str, room: int) -> str:
    """A text of at most `room` columns; an ellipsis stands for what does not fit."""
    if _columns(text) <= room:
        return text
    while text and _columns(text) >= room:
        text = text[:-1]
    return f"{text}…"


def _columns(text: str) -> int:
    """How many columns a text takes: East Asian characters take two, and combining marks none."""
    return sum(0 if combining(each) else 2 if east_asian_width(each) in "WF" else 1 for each in text)


def ready_table(ready: str, log_file: str | None) -> list[str]:
    """The lines that a terminal shows in place of the line `ready NAME ADDRESS NAME ADDRESS …`."""
    words = ready.split()[1:]
    addresses = dict(zip(words[::2], words[1::2], strict=True))
    names = [*(name for name in FIRST if name in addresses), *(name for name in addresses if name not in FIRST)]
    rows = [(name, addresses[name], HINTS.get(name, "")) for name in names]
    return ["ready", *_aligned(rows), *([f"  log: {log_file}"] if log_file else []), "Ctrl-C stops the server"]


def _aligned(rows: Iterable[tuple[str, str, str]]) -> list[str]:
    rows = list(rows)
    first, second = (max(len(row[i]) for row in rows) for i in (0, 1))
    return [f"  {name:{first}}  {address:{second}}  {hint}".rstrip() for name, address, hint in rows]
