"""A batch on this machine: a few processes, each doing one take after the other.

A process that dies, of a crash or because memory ran out, costs the take it was at; a new one takes its place.
"""

import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait

from manipnet_tools.batch.job import Job, Outcome, do

END_S = 1.0
"""What an idle process gets to end by itself."""

Progress = Callable[[str, int, int], None]
"""Hears the name of a job, and how many of its hand-ticks are done, of how many."""


class Worker:
    """A process and the job it is at."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, far = context.Pipe()
        self.job: Job | None = None
        self._process = context.Process(target=_serve, args=(far,), daemon=True)
        self._process.start()
        far.close()

    def begin(self, job: Job) -> "Worker":
        """Send it to work; returns itself, or a new one if it has died since its last job."""
        try:
            self.connection.send(job)
        except OSError:
            self.end()
            return Worker().begin(job)
        self.job = job
        return self

    def end(self) -> str:
        """End the process; how it had ended."""
        self.connection.close()
        self._process.join(END_S)
        code = self._process.exitcode
        self._process.kill()
        self._process.join()
        return f"killed by {signal.Signals(-code).name}" if code is not None and code < 0 else f"exit status {code}"


def run_here(jobs: Sequence[Job], processes: int, progress: Progress) -> Iterator[Outcome]:
    """Do the jobs with that many processes; outcomes as they come. Closing the iterator ends the processes."""
    waiting = deque(jobs)
    workers = [Worker() for _ in range(min(processes, len(jobs)))]
    try:
        workers = [worker.begin(waiting.popleft()) for worker in workers]
        while busy := {worker.connection: worker for worker in workers if worker.job is not None}:
            for connection in wait(list(busy)):
                worker = busy[connection]  # type: ignore[index]
                outcome = _hear(worker, progress)
                if outcome is None:
                    continue
                worker.job = None
                if waiting:
                    workers.remove(worker)
                    workers.append(worker.begin(waiting.popleft()))
                yield outcome
    finally:
        for worker in workers:
            worker.end()


def _hear(worker: Worker, progress: Progress) -> Outcome | None:
    """What a worker says: its outcome, or None for progress. A dead one's outcome is a failure."""
    assert worker.job is not None
    try:
        said = worker.connection.recv()
    except (EOFError, OSError):
        reason = f"its process died ({worker.end()}): out of memory? Try fewer --jobs, or a smaller take or mesh"
        return Outcome(worker.job.name, "failed", reason=reason)
    if isinstance(said, Outcome):
        return said
    progress(worker.job.name, *said)
    return None


def _serve(connection: Connection) -> None:
    """The process of a worker: do what comes, until nobody is there to hear of it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    try:
        while True:
            job = connection.recv()
            connection.send(do(job, lambda done, total: _tell(connection, done, total)))
    except (EOFError, OSError):
        pass


def _tell(connection: Connection, done: int, total: int) -> None:
    if done % 120 == 0 or done == total:  # once a second of the take
        connection.send((done, total))
