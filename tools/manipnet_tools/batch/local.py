"""Runs a batch on this machine, in several processes that do one take after the other.

When a process dies, because of a crash or for lack of memory, only its current take fails, and a new process takes its
place.
"""

import os
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait

from manipnet.runtime.child_process import ChildProcess
from manipnet_tools.batch.job import Job, Outcome, do

END_S = 1.0
"""Time in which an idle process may end by itself."""

Progress = Callable[[str, int, int], None]
"""Receives the name of a job, the number of its hand-ticks done and their total."""


class Worker:
    """A process and its current job."""

    def __init__(self) -> None:
        self.job: Job | None = None
        self._child = ChildProcess("batch", _serve)
        self.connection = self._child.connection

    def begin(self, job: Job) -> "Worker":
        """Start a job; returns this worker, or a new one if the process has died since its last job."""
        try:
            self.connection.send(job)
        except OSError:
            self.end()
            return Worker().begin(job)
        self.job = job
        return self

    def end(self) -> str:
        """End the process, and return how it ended."""
        self._child.close(END_S)
        code = self._child.exit_code
        self._child.kill()
        return f"killed by {signal.Signals(-code).name}" if code is not None and code < 0 else f"exit status {code}"


def run_locally(jobs: Sequence[Job], processes: int, progress: Progress) -> Iterator[Outcome]:
    """Do the jobs with a number of processes, and yield outcomes as they arrive. Closing the iterator ends the
    processes."""
    waiting = deque(jobs)
    workers = [Worker() for _ in range(min(processes, len(jobs)))]
    try:
        workers = [worker.begin(waiting.popleft()) for worker in workers]
        while busy := {worker.connection: worker for worker in workers if worker.job is not None}:
            for connection in wait(list(busy)):
                worker = busy[connection]  # type: ignore[index]
                outcome = _receive(worker, progress)
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


def _receive(worker: Worker, progress: Progress) -> Outcome | None:
    """A worker's outcome, or None if it reported progress. The outcome of a dead worker is a failure."""
    assert worker.job is not None
    try:
        received = worker.connection.recv()
    except (EOFError, OSError):
        remedy = "perhaps for lack of memory; try fewer --jobs, a shorter take or a smaller mesh"
        return Outcome(worker.job.name, "failed", reason=f"its process died ({worker.end()}), {remedy}")
    if isinstance(received, Outcome):
        return received
    progress(worker.job.name, *received)
    return None


def _serve(connection: Connection) -> None:
    """The process of a worker: do jobs until the other end closes the connection."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    try:
        while True:
            job = connection.recv()
            connection.send(do(job, lambda done, total: _report(connection, done, total)))
    except (EOFError, OSError):
        pass


def _report(connection: Connection, done: int, total: int) -> None:
    if done % 120 == 0 or done == total:  # once a second of the take
        connection.send((done, total))
