"""Runs parts of a batch on several cores: compiled kernels and the ray tracer need no interpreter's lock."""

import os
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Final

LEAST_HANDS: Final = 4
"""A part has at least this many hands, because starting and joining another thread costs as much as two of them."""
MOST_PARTS: Final = 4


def part_count(hands: int) -> int:
    """Into how many parts a batch of hands is cut, by its size and the cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    cores = len(affinity(0)) if affinity else os.cpu_count() or 1
    return max(min(hands // LEAST_HANDS, cores, MOST_PARTS), 1)


def cuts(held: Sequence[Hashable], parts: int) -> list[int]:
    """Where a batch is cut into parts of about the same size: the beginning of each, and the end.

    Neighbours that hold the same are not cut apart, because what one of them does depends on the other.
    """
    places = [0]
    for part in range(1, parts):
        place = max(len(held) * part // parts, places[-1])
        while 0 < place < len(held) and held[place] == held[place - 1]:
            place += 1
        places.append(place)
    return [*places, len(held)]


class SideBySide:
    """Threads for the parts of a batch after the first; they are started when a batch has several parts."""

    def __init__(self) -> None:
        self._pool: ThreadPoolExecutor | None = None

    def run(self, job: Callable[[int], None], parts: int) -> None:
        """Call `job` with the number of each part, the first one on this thread. Raises what a part raises."""
        if parts > 1 and self._pool is None:
            self._pool = ThreadPoolExecutor(MOST_PARTS - 1, thread_name_prefix="hands")
        others = [self._pool.submit(job, part) for part in range(1, parts)] if self._pool is not None else []
        try:
            job(0)
        finally:
            for other in others:
                other.exception()  # nobody may write into the batch after this call
        for other in others:
            other.result()
