"""`manipnet batch`: fingers for a folder of takes."""

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.table import Table

from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.model.providers import DEFAULT_MODEL, MAX_LOOK_AHEAD_S
from manipnet.synthesis.objects.mesh import load_mesh
from manipnet_tools.batch.job import Job, Outcome, keep
from manipnet_tools.batch.local import run_here
from manipnet_tools.takes.rigged import read_rig

FILE_TAKES = (".csv", ".mcap", ".txt")
SUMMARY = "summary.json"
TICK_HZ = 60.0


class BatchError(ValueError):
    """A batch that cannot be begun, or of which a part failed; the text says what and what to do."""


@dataclass(frozen=True)
class BatchOptions:
    """Write the fingers of every take in a folder, as `manipnet synthesize` does for one.

    What is finished and still up to date is skipped, so a batch that was stopped goes on where it was. A take that
    fails is reported, and the rest goes on.
    """

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FOLDER")]
    """Where the takes are, at any depth: folders of BVH files, trajectory texts, Motive CSVs, recordings."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Where the results go: one .npz per take and summary.json."""
    mesh: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="NAME=FILE")] = ()
    """Mesh of an object, in metres, for all takes that have one of that name; recordings may keep their own."""
    model: Annotated[str, tyro.conf.arg(metavar="NAME")] = DEFAULT_MODEL
    """A shipped bundle's name or a bundle folder."""
    look_ahead: Annotated[float, tyro.conf.arg(metavar="SECONDS")] = MAX_LOOK_AHEAD_S
    """Seconds of the future the synthesis knows, 0 to 0.5; the rest it forecasts."""
    rig: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The rig of all takes: whose bodies are what, calibrated; recordings of a server know by themselves."""
    actor: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Who of a rig with several actors; the first by default."""
    jobs: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Takes at a time on this machine; by default one per processor."""
    ray: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS")] = None
    """Work on this Ray cluster instead: HOST:PORT, auto, or local for one of its own here."""


def run(options: BatchOptions) -> None:
    """Do what is not done yet. Raises `BatchError`, `BundleError`, `MeshError`, `ClusterError` and `OSError`."""
    jobs = plan(options)
    options.out.mkdir(parents=True, exist_ok=True)
    console = Console(stderr=True)
    outcomes: list[Outcome] = []
    try:
        with ExitStack() as opened:
            bars = opened.enter_context(_Bars(console, len(jobs)))
            for outcome in _outcomes(options, jobs, bars, opened):
                outcomes.append(outcome)
                bars.finish(outcome)
    finally:
        outcomes.sort(key=lambda outcome: outcome.name)
        report = {"model": options.model, "look_ahead_s": options.look_ahead, "takes": [asdict(o) for o in outcomes]}
        keep(options.out / SUMMARY, json.dumps(report, indent=2).encode())
        console.print(table(outcomes))
        if len(outcomes) < len(jobs):
            console.print(f"{len(jobs) - len(outcomes)} takes are left; the same command goes on with them")
    if failed := sum(outcome.state == "failed" for outcome in outcomes):
        raise BatchError(
            f"{failed} of {len(jobs)} takes failed, for the reasons above; the others are in {options.out}"
        )


def plan(options: BatchOptions) -> list[Job]:
    """A job per take. Raises `BatchError`, `BundleError`, `MeshError`, `ConfigError` and `TakeError` for what no take
    could be done with."""
    if not 0.0 <= options.look_ahead <= MAX_LOOK_AHEAD_S:
        raise BatchError(f"--look-ahead is {options.look_ahead} s; allowed are 0 to {MAX_LOOK_AHEAD_S}")
    if options.jobs is not None and options.jobs < 1:
        raise BatchError(f"--jobs is {options.jobs}; allowed are 1 and more")
    takes = find_takes(options.folder)
    if not takes:
        raise BatchError(f"{options.folder}: holds no take; a take is a folder of BVH files, {', '.join(FILE_TAKES)}")
    meshes = {}
    for text in options.mesh:
        name, equals, file = text.partition("=")
        if not (name and equals and file):
            raise BatchError(f"--mesh {text}: must be NAME=FILE, NAME an object of one of the takes")
        load_mesh(file)
        meshes[name] = Path(file).absolute()
    model, rig = load_bundle(options.model).folder.absolute(), read_rig(options.rig, options.actor)
    names = take_names(options.folder, takes)
    return [
        Job(name, take.absolute(), meshes, model, options.look_ahead, rig, options.out.absolute() / f"{name}.npz")
        for take, name in zip(takes, names, strict=True)
    ]


def find_takes(folder: Path) -> list[Path]:
    """All takes in a folder, itself included, at any depth. Raises `BatchError` where there is no folder."""
    if not folder.is_dir():
        raise BatchError(f"{folder}: is no folder; for a single take there is `manipnet synthesize`")
    folders = [place for place in [folder, *folder.rglob("*")] if place.is_dir() and any(place.glob("*Hand.bvh"))]
    files = [file for file in folder.rglob("*") if file.suffix.lower() in FILE_TAKES and file.is_file()]
    return sorted([*folders, *(file for file in files if file.suffix.lower() != ".txt" or _is_trajectory(file))])


def take_names(folder: Path, takes: Sequence[Path]) -> list[str]:
    """A name for each take: its path in the folder, without the suffix where that tells them apart."""
    paths = ["_".join(take.relative_to(folder).parts) or folder.absolute().name for take in takes]
    short = [Path(path).stem if take.is_file() else path for path, take in zip(paths, takes, strict=True)]
    return [path if short.count(name) > 1 else name for path, name in zip(paths, short, strict=True)]


def _is_trajectory(file: Path) -> bool:
    """Folders hold all sorts of texts; a trajectory's first line is a number."""
    with file.open(errors="replace") as text:
        try:
            float(text.readline(100))
        except ValueError:
            return False
    return True


def _outcomes(options: BatchOptions, jobs: Sequence[Job], bars: "_Bars", opened: ExitStack) -> Iterator[Outcome]:
    processes = options.jobs or os.cpu_count() or 1
    if options.ray is None:
        return run_here(jobs, processes, bars.advance)
    from manipnet_tools.batch.cluster import cluster, run_there

    processors = opened.enter_context(cluster(options.ray, processes))
    return run_there(jobs, processors, bars.advance)


def table(outcomes: Sequence[Outcome]) -> Table:
    """One line per take."""
    lines = Table("take", "result", "length", "took", "times real time", "why")
    colours = {"done": "green", "skipped": "dim", "failed": "red"}
    for outcome in outcomes:
        length_s = outcome.frames / TICK_HZ
        lines.add_row(
            outcome.name,
            f"[{colours[outcome.state]}]{'up to date' if outcome.state == 'skipped' else outcome.state}[/]",
            f"{length_s:.1f} s" if outcome.frames else "",
            f"{outcome.seconds:.1f} s" if outcome.state == "done" else "",
            f"{length_s / outcome.seconds:.1f}" if outcome.state == "done" else "",
            outcome.reason.replace("[", "\\["),
        )
    return lines


class _Bars:
    """A bar for all takes, and one for each that is being done."""

    def __init__(self, console: Console, takes: int) -> None:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._progress = Progress(*columns, console=console)
        self._all = self._progress.add_task("takes", total=takes)
        self._takes: dict[str, TaskID] = {}

    def __enter__(self) -> "_Bars":
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def advance(self, name: str, done: int, total: int) -> None:
        if name not in self._takes:
            self._takes[name] = self._progress.add_task(f"  {name}", total=total or None)
        self._progress.update(self._takes[name], completed=done, total=total or None)

    def finish(self, outcome: Outcome) -> None:
        if (bar := self._takes.pop(outcome.name, None)) is not None:
            self._progress.remove_task(bar)
        self._progress.advance(self._all)
        if outcome.state == "failed":
            self._progress.print(f"{outcome.name} failed: {outcome.reason}", markup=False)
