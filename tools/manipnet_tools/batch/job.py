"""One take of a batch: what its result depends on, and how it is synthesised, on this machine or another."""

import hashlib
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Literal

from manipnet import __version__
from manipnet.common.atomic_file import replacing
from manipnet.synthesis.hand.profile import read_profile
from manipnet.synthesis.model.bundle import Bundle, load_bundle
from manipnet.synthesis.synthesizer import Synthesizer
from manipnet_tools.commands.synthesize import read_shapes, synthesise, write_arrays
from manipnet_tools.takes.bvh_folder import bvh_files
from manipnet_tools.takes.rigged import RiggedTake, RigText, read_rigged
from manipnet_tools.takes.rollout import tick_take
from manipnet_tools.takes.take import TakeError

Advance = Callable[[int, int], None]
"""Receives the number of hand-ticks done and their total."""


@dataclass(frozen=True)
class Job:
    """A take to synthesise, with the meshes, the model and the settings to use."""

    name: str
    """The name of the take within the batch, which is also that of its result."""
    take: Path
    meshes: Mapping[str, Path]
    """Mesh files by object, which may include objects that are not in this take."""
    model: Path
    """The bundle's folder."""
    look_ahead_s: float
    rig: RigText | None
    """The rig file, for a take that does not say which body is which."""
    out: Path
    """The file to write, .npz. A .json file of the same name holds a hash of everything the result depends on."""

    up: Literal["y", "z"] = "y"
    """The axis that points up in the take."""
    hand: Path | None = None
    """The profile of an avatar's hand, on which the take is solved too."""

    @property
    def note(self) -> Path:
        """The .json file beside the result."""
        return self.out.with_name(f"{self.out.stem}.json")


@dataclass(frozen=True)
class Outcome:
    """How a job ended."""

    name: str
    state: Literal["done", "skipped", "failed"]
    frames: int = 0
    seconds: float = 0.0
    """Duration of the work."""
    reason: str = ""
    """The reason of a failure."""


@dataclass(frozen=True)
class Prepared:
    """A job whose take has been read, with the meshes of its objects and a hash of all that the result depends on."""

    job: Job
    rigged: RiggedTake
    meshes: dict[str, Path]
    key: str


def do(job: Job, advance: Advance = lambda done, total: None) -> Outcome:
    """Synthesise one take unless its result is up to date. An error becomes a failed outcome."""
    start_s = time.monotonic()
    try:
        prepared = prepare(job)
        return finished(prepared) or _make(prepared, advance, start_s)
    except (ValueError, OSError) as error:
        return failure(job, error, time.monotonic() - start_s)


def failure(job: Job, error: Exception, seconds: float = 0.0) -> Outcome:
    """The outcome of a job that failed. Its reason does not repeat the name of the take."""
    return Outcome(job.name, "failed", seconds=seconds, reason=str(error).removeprefix(f"{job.take}: "))


def prepare(job: Job) -> Prepared:
    """Read the take, and hash everything that the result depends on.

    Raises `TakeError`, `ConfigError`, `BundleError` and `OSError`.
    """
    rigged = read_rigged(job.take, job.rig, job.up)
    take, rig_meshes = rigged.take, {} if job.rig is None else job.rig.meshes
    meshes = {name: file for name, file in sorted(job.meshes.items()) if name in take.objects}
    if not meshes and job.meshes and job.take.suffix.lower() != ".mcap" and not rig_meshes:
        objects, given = ", ".join(take.objects) or "none", ", ".join(job.meshes)
        raise TakeError(f"{job.take}: its objects are {objects}, but --mesh names {given}")
    digest = hashlib.sha256(f"{__version__} {_bundle(job.model).model_hash} {job.look_ahead_s} {job.up}".encode())
    if job.rig is not None:
        digest.update(f"{job.rig.actor} {job.rig.text}".encode())
    if job.hand is not None:
        digest.update(b" hand " + job.hand.read_bytes())
    of_rig = ((name, file.path) for name, file in sorted(rig_meshes.items()))
    for name, file in [*((file.name, file) for file in take_files(job.take)), *meshes.items(), *of_rig]:
        digest.update(f" {name} {file.stat().st_size} ".encode() + file.read_bytes())
    return Prepared(job, rigged, meshes, digest.hexdigest())


def take_files(take: Path) -> list[Path]:
    """The files that make up a take."""
    return bvh_files(take) if take.is_dir() else [take]


def finished(prepared: Prepared) -> Outcome | None:
    """The outcome of an earlier run that made the same result, or None."""
    try:
        note = json.loads(prepared.job.note.read_text(encoding="utf-8"))
        if note.pop("key") == prepared.key and prepared.job.out.is_file():
            return replace(Outcome(**note), state="skipped")
    except (OSError, ValueError, KeyError, TypeError):
        pass  # the note is missing or cut off, so the result is made again
    return None


def _make(prepared: Prepared, advance: Advance, start_s: float) -> Outcome:
    job, take = prepared.job, prepared.rigged.take
    shapes = read_shapes([f"{name}={file}" for name, file in prepared.meshes.items()], take, job.take, job.rig)
    ticks = tick_take(take, job.look_ahead_s)
    total, done = 2 * len(ticks.time_s), 0

    def count(steps: int) -> None:
        nonlocal done
        done += steps
        advance(done, total)

    advance(0, total)
    profile = None if job.hand is None else read_profile(job.hand)
    hands = synthesise(Synthesizer(_bundle(job.model)), ticks, shapes, count, prepared.rigged.hand_scale, profile)
    with replacing(job.out) as file:
        write_arrays(file, ticks, shapes, hands)
    outcome = Outcome(job.name, "done", len(ticks.time_s), time.monotonic() - start_s)
    with replacing(job.note) as file:
        file.write(json.dumps(asdict(outcome) | {"key": prepared.key}, indent=2).encode())
    return outcome


@lru_cache(maxsize=1)
def _bundle(model: Path) -> Bundle:
    """Load the bundle once per process."""
    return load_bundle(model)
