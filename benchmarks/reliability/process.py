"""Memory, descriptors and threads of processes, read from /proc (Linux)."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Usage:
    """A process and its children together: private and resident memory in MB, open descriptors, threads."""

    own_mb: float
    resident_mb: float
    descriptors: int
    threads: int
    processes: int


def usage(pid: int) -> Usage:
    """Read the usage of a process; raises `OSError` when it has ended."""
    family = [pid, *_descendants(pid)]
    parts = [_one(member) for member in family]
    return Usage(*(sum(column) for column in zip(*parts, strict=True)), processes=len(family))


def _one(pid: int) -> tuple[float, float, int, int]:
    folder = Path("/proc") / str(pid)
    memory = _fields(folder / "smaps_rollup")
    own_kb = memory["Private_Clean"] + memory["Private_Dirty"] + memory.get("Private_Hugetlb", 0)
    threads = len(list((folder / "task").iterdir()))
    return own_kb * 1024 / 1e6, memory["Rss"] * 1024 / 1e6, len(list((folder / "fd").iterdir())), threads


def _fields(path: Path) -> dict[str, int]:
    lines = (line.split() for line in path.read_text(encoding="ascii").splitlines()[1:])
    return {words[0].rstrip(":"): int(words[1]) for words in lines if len(words) > 1}


def _descendants(pid: int) -> list[int]:
    children: list[int] = []
    for task in (Path("/proc") / str(pid) / "task").iterdir():
        with suppress(FileNotFoundError):  # the thread has just ended
            children += [int(word) for word in (task / "children").read_text(encoding="ascii").split()]
    return children + [grandchild for child in children for grandchild in _descendants(child)]
