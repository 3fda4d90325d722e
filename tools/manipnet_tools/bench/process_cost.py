"""Reads what a process and its children have used: processor time, wake-ups and memory. Linux only, from /proc."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_PROC = Path("/proc")


@dataclass(frozen=True)
class Usage:
    """Totals of a process and of its children since they started."""

    processor_s: float
    """Processor time of all threads, seconds."""
    wake_ups: int
    """How often a thread that waited was given a processor."""


def usage(process_id: int) -> Usage:
    """The totals of a process and its children, so far. Raises `OSError` on a system without /proc."""
    threads = [task for process in _family(process_id) for task in (_PROC / str(process) / "task").iterdir()]
    nanoseconds, switches = 0, 0
    for task in threads:
        try:
            nanoseconds += int((task / "schedstat").read_text(encoding="ascii").split()[0])
            switches += _numbers(task / "status")["voluntary_ctxt_switches"]
        except (FileNotFoundError, ProcessLookupError):  # the thread has just ended
            continue
    return Usage(1e-9 * nanoseconds, switches)


def own_memory_mb(process_id: int) -> float:
    """Memory in MB that only this process has: what it wrote, without the libraries that it shares.

    Raises `OSError` on a system without /proc.
    """
    return _numbers(_PROC / str(process_id) / "status")["RssAnon"] * 1024 / 1e6


def _family(process_id: int) -> Iterator[int]:
    yield process_id
    for task in (_PROC / str(process_id) / "task").iterdir():
        for child in (task / "children").read_text(encoding="ascii").split():
            yield from _family(int(child))


def _numbers(status: Path) -> dict[str, int]:
    rows = [line.split(":", 1) for line in status.read_text(encoding="utf-8", errors="replace").splitlines()]
    return {name: int(words[0]) for name, text in rows if (words := text.split()) and words[0].isdigit()}


def supported() -> bool:
    """Whether this system reports what a process uses."""
    return Path(f"/proc/self/task/{os.getpid()}/children").is_file()
