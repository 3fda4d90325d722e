"""Memory, descriptors, threads and processor time of processes, read from /proc (Linux)."""

import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Usage:
    """Private and resident memory in MB, open descriptors, threads, and processor time in seconds."""

    own_mb: float
    resident_mb: float
    descriptors: int
    threads: int
    cpu_s: float

    def __add__(self, other: "Usage") -> "Usage":
        return Usage(
            self.own_mb + other.own_mb,
            self.resident_mb + other.resident_mb,
            self.descriptors + other.descriptors,
            self.threads + other.threads,
            self.cpu_s + other.cpu_s,
        )


def usage(pid: int) -> Usage:
    """The usage of a process and its children together; raises `OSError` when it has ended."""
    total = usage_of(pid)
    for _, used in usage_of_children(pid):
        total += used
    return total


def usage_of_children(pid: int) -> Iterator[tuple[int, Usage]]:
    """The number and the usage of each child of a process, and of their children, except those that have ended."""
    for child in _descendants(pid):
        with suppress(OSError, KeyError):  # it has just ended
            yield child, usage_of(child)


def usage_of(pid: int) -> Usage:
    """The usage of one process; raises `OSError` when it has ended."""
    folder = Path("/proc") / str(pid)
    memory = _fields(folder / "smaps_rollup")
    own_kb = memory["Private_Clean"] + memory["Private_Dirty"] + memory.get("Private_Hugetlb", 0)
    threads = len(list((folder / "task").iterdir()))
    times = (folder / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()[11:13]
    return Usage(
        own_kb * 1024 / 1e6,
        memory["Rss"] * 1024 / 1e6,
        len(list((folder / "fd").iterdir())),
        threads,
        sum(map(int, times)) / os.sysconf("SC_CLK_TCK"),
    )


def _fields(path: Path) -> dict[str, int]:
    lines = (line.split() for line in path.read_text(encoding="ascii").splitlines()[1:])
    return {words[0].rstrip(":"): int(words[1]) for words in lines if len(words) > 1}


def _descendants(pid: int) -> list[int]:
    children: list[int] = []
    with suppress(OSError):
        for task in (Path("/proc") / str(pid) / "task").iterdir():
            with suppress(OSError):  # the thread has just ended
                children += [int(word) for word in (task / "children").read_text(encoding="ascii").split()]
    return children + [grandchild for child in children for grandchild in _descendants(child)]
