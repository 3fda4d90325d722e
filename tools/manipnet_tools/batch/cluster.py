"""Runs a batch on a Ray cluster. Jobs carry their files with them, so the machines need no common disk, only the same
version of this program. The number of submitted jobs is bounded, and so is their memory.

Source: docs.ray.io, "Tasks" and "Using ray.wait to limit the number of pending tasks".
"""

import hashlib
import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from typing import Any, Final

import ray
from ray.exceptions import RayError

from manipnet.common.atomic_file import replacing
from manipnet_tools.batch.job import Job, Outcome, do, failure, finished, prepare, take_files
from manipnet_tools.batch.local import Progress
from manipnet_tools.takes.rigged import RigText

OWN: Final = "local"
"""Used instead of an address, this starts a cluster on this machine that lives as long as the batch."""
OBJECT_STORE_BYTES: Final = 256 << 20
AHEAD: Final = 2
"""How many more jobs are submitted than can run at the same time."""

Files = dict[str, bytes]


class ClusterError(ValueError):
    """A cluster cannot be used; the text names it, the reason and the remedy."""


@dataclass(frozen=True)
class PackedJob:
    """A job with the contents of its files, as it is sent to another machine."""

    name: str
    take: Files
    folder: str | None
    """The name of a take that is a folder."""
    look_ahead_s: float


@contextmanager
def cluster(address: str, processes: int) -> Iterator[int]:
    """Join the cluster at `address`, or start one for `OWN`, and yield its number of processors.

    In the end, a cluster that was started here is shut down; any other keeps running.
    """
    options: dict[str, Any] = {"address": address, "log_to_driver": False, "logging_level": logging.ERROR}
    if address == OWN:
        options |= {"num_cpus": processes, "object_store_memory": OBJECT_STORE_BYTES, "include_dashboard": False}
    try:
        ray.init(**options)
    except (ConnectionError, RuntimeError, ValueError, OSError) as error:
        remedy = (
            f"give the address that `ray start --head` prints, auto for this machine's cluster, or {OWN} to start one"
        )
        raise ClusterError(f"--ray {address}: cannot join a cluster ({str(error).splitlines()[0]}); {remedy}") from None
    try:
        yield max(1, int(ray.cluster_resources().get("CPU", 1)))
    finally:
        ray.shutdown()


def run_on_cluster(jobs: Sequence[Job], processors: int, progress: Progress) -> Iterator[Outcome]:
    """Do the jobs on the joined cluster, write the results on this machine and yield outcomes as they arrive."""
    if not jobs:
        return
    model = ray.put(_read(sorted(file for file in jobs[0].model.iterdir() if file.is_file())))
    meshes = {name: ray.put((file.name, file.read_bytes())) for name, file in jobs[0].meshes.items()}
    rig = ray.put(_packed(jobs[0].rig))
    remote = ray.remote(num_cpus=1, max_retries=1)(_do_packed)
    running: dict[Any, Job] = {}
    for job in jobs:
        while len(running) >= processors + AHEAD:
            yield _next(running)
        try:
            prepared = prepare(job)
            if (made := finished(prepared)) is not None:
                yield made
                continue
            packed = PackedJob(job.name, _read(take_files(job.take)), _folder(job.take), job.look_ahead_s)
        except (ValueError, OSError) as error:
            yield failure(job, error)
            continue
        own = {name: meshes[name] for name in prepared.meshes}
        running[remote.remote(packed, model, rig, list(own), *own.values())] = job
        progress(job.name, 0, 0)
    while running:
        yield _next(running)


def _next(running: dict[Any, Job]) -> Outcome:
    """Wait for one of the tasks to end, and write its result."""
    (task,), _ = ray.wait(list(running), num_returns=1)
    job = running.pop(task)
    try:
        outcome, npz, note = ray.get(task)
    except RayError as error:
        reason = str(error).strip().splitlines()[-1] if str(error).strip() else type(error).__name__
        return Outcome(job.name, "failed", reason=f"the cluster did not finish it: {reason}")
    if outcome.state == "failed":
        return outcome
    try:
        for path, content in ((job.out, npz), (job.note, note)):
            with replacing(path) as file:
                file.write(content)
    except OSError as error:
        return Outcome(job.name, "failed", reason=str(error))
    return outcome


def _do_packed(
    packed: PackedJob,
    model: Files,
    rig: tuple[RigText, Files] | None,
    names: list[str],
    *meshes: tuple[str, bytes],
) -> tuple[Outcome, bytes, bytes]:
    """Do a job on a machine of the cluster, in a temporary folder.

    Returns the outcome and the contents of the result and its note.
    """
    with TemporaryDirectory(prefix="manipnet-") as folder:
        place = Path(folder)
        take = place / "take" / (packed.folder or "")
        _write(take, packed.take)
        take = take if packed.folder else take / next(iter(packed.take))
        files = {}
        for name, (file, content) in zip(names, meshes, strict=True):
            _write(place / f"mesh{len(files)}", {file: content})
            files[name] = place / f"mesh{len(files)}" / file
        rig_here = None if rig is None else _unpacked(*rig, place / "rig")
        job = Job(packed.name, take, files, _model_here(model), packed.look_ahead_s, rig_here, place / "result.npz")
        outcome = do(job)
        if outcome.state == "failed":
            return outcome, b"", b""
        return outcome, job.out.read_bytes(), job.note.read_bytes()


def _model_here(files: Files) -> Path:
    """The bundle's folder on this machine, which is written once."""
    digest = hashlib.sha256(b"".join(files[name] for name in sorted(files))).hexdigest()[:24]
    folder = Path(gettempdir()) / f"manipnet-model-{digest}"
    if not folder.is_dir():
        with TemporaryDirectory(dir=folder.parent) as part:
            _write(Path(part) / "bundle", files)
            try:
                (Path(part) / "bundle").rename(folder)
            except OSError:
                assert folder.is_dir(), "another process was first"
    return folder


def _packed(rig: RigText | None) -> tuple[RigText, Files] | None:
    """A rig with the contents of its mesh files, in the order of its props."""
    if rig is None:
        return None
    return rig, {f"{k}{mesh.path.suffix}": mesh.path.read_bytes() for k, mesh in enumerate(rig.meshes.values())}


def _unpacked(rig: RigText, files: Files, folder: Path) -> RigText:
    _write(folder, files)
    here = (replace(mesh, path=folder / file) for mesh, file in zip(rig.meshes.values(), files, strict=True))
    return replace(rig, meshes=dict(zip(rig.meshes, here, strict=True)))


def _folder(take: Path) -> str | None:
    return take.name if take.is_dir() else None


def _read(files: Sequence[Path]) -> Files:
    return {file.name: file.read_bytes() for file in files}


def _write(folder: Path, files: Files) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)
