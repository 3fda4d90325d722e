"""Makes takes on a Ray cluster. A job is a number and a seed, and a result is a take, so no disk is shared."""

from collections.abc import Iterator, Sequence
from typing import Final

import ray

from manipnet_tools.generate.job import MadeTake, make_take

AHEAD: Final = 2
"""How many more jobs are submitted than can run at the same time."""


def made_on_cluster(numbers: Sequence[int], seed: int, processors: int) -> Iterator[MadeTake]:
    """The takes of these numbers as the joined cluster finishes them."""
    remote = ray.remote(num_cpus=1, max_retries=1)(make_take)
    waiting, running = list(reversed(numbers)), []
    while waiting or running:
        while waiting and len(running) < processors + AHEAD:
            running.append(remote.remote(waiting.pop(), seed))
        done, running = ray.wait(running, num_returns=1)
        yield ray.get(done[0])
