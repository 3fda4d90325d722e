"""`manipnet batch`: synthesises the fingers of all takes in a folder."""

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from manipnet.common.atomic_file import replacing
from manipnet.synthesis.hand.shipped_files import hand_file
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.objects.mesh import load_mesh
from manipnet.tracking.tick import TICK_HZ
from manipnet_tools.batch.job import Job, Outcome
from manipnet_tools.batch.local import run_locally
from manipnet_tools.commands.options import BatchOptions
from manipnet_tools.commands.synthesize import profile_of
from manipnet_tools.takes.bvh_folder import bvh_files
from manipnet_tools.takes.meshes import named_files
from manipnet_tools.takes.rigged import read_rig
from manipnet_tools.takes.take import TRACKED_FORMATS
from manipnet_tools.terminal import open_console

FILE_TAKES = (".csv", ".mcap", ".txt")
SUMMARY = "summary.json"
COLOURS = {"done": "green", "skipped": "dim", "failed": "red"}


class BatchError(ValueError):
    """A batch cannot start, or some of its takes failed; the text names the reason and the remedy."""


def run(options: BatchOptions) -> None:
    """Make every result that is missing or out of date.

    Raises `BatchError`, `BundleError`, `MeshError`, `ClusterError` and `OSError`.
    """
    jobs = plan(options)
    options.out.mkdir(parents=True, exist_ok=True)
    console = open_console()
    outcomes: list[Outcome] = []
    try:
        with ExitStack() as opened:
            bars = opened.enter_context(_ProgressBars(console, len(jobs)))
            for outcome in _outcomes(options, jobs, bars, opened):
                outcomes.append(outcome)
                bars.finish(outcome)
    finally:
        outcomes.sort(key=lambda outcome: outcome.name)
        summary = {"model": options.model, "look_ahead_s": options.look_ahead, "takes": [asdict(o) for o in outcomes]}
        with replacing(options.out / SUMMARY) as file:
            file.write(json.dumps(summary, indent=2).encode())
        if outcomes:
            console.print(table(outcomes), soft_wrap=False)
        if outcomes and len(outcomes) < len(jobs):
            console.print(f"{len(jobs) - len(outcomes)} takes are left; run the same command again to continue")
    if failed := sum(outcome.state == "failed" for outcome in outcomes):
        raise BatchError(
            f"{failed} of {len(jobs)} takes failed, for the reasons above; the other results are in {options.out}"
        )


def plan(options: BatchOptions) -> list[Job]:
    """One job per take.

    Raises `BatchError`, `BundleError`, `MeshError`, `ConfigError` and `TakeError` for options that would make every
    take fail.
    """
    takes = find_takes(options.folder)
    if not takes:
        raise BatchError(
            f"{options.folder}: no take found; a take is a folder of BVH files, or a file {', '.join(FILE_TAKES)}"
        )
    meshes = {name: file.absolute() for name, file in named_files(options.mesh).items()}
    for file in meshes.values():
        load_mesh(file)  # a mesh that cannot be read would make every take fail
    model, rig = load_bundle(options.model).folder.absolute(), read_rig(options.rig, options.actor)
    profile_of(options.hand, rig)  # so would a profile
    hand = hand_file(options.hand) if options.hand else None if rig is None else rig.hand
    names = take_names(options.folder, takes)
    return [
        Job(
            name,
            take.absolute(),
            meshes,
            model,
            options.look_ahead,
            rig,
            options.out.absolute() / f"{name}.npz",
            options.up if take.suffix.lower() in TRACKED_FORMATS else "y",
            None if hand is None else hand.absolute(),
        )
        for take, name in zip(takes, names, strict=True)
    ]


def find_takes(folder: Path) -> list[Path]:
    """All takes in a folder at any depth, the folder itself included."""
    places = [place for place in [folder, *folder.rglob("*")] if place.is_dir()]
    folders = [place for place in places if any(file.stem.lower().endswith("hand") for file in bvh_files(place))]
    files = [file for file in folder.rglob("*") if file.suffix.lower() in FILE_TAKES and file.is_file()]
    return sorted([*folders, *(file for file in files if file.suffix.lower() != ".txt" or _is_trajectory(file))])


def take_names(folder: Path, takes: Sequence[Path]) -> list[str]:
    """A name for each take: its path in the folder, without the suffix unless two takes differ only in that."""
    paths = ["_".join(take.relative_to(folder).parts) or folder.absolute().name for take in takes]
    short = [Path(path).stem if take.is_file() else path for path, take in zip(paths, takes, strict=True)]
    return [path if short.count(name) > 1 else name for path, name in zip(paths, short, strict=True)]


def _is_trajectory(file: Path) -> bool:
    """Whether a text is a trajectory, whose first line is a number."""
    with file.open(errors="replace") as text:
        try:
            float(text.readline(100))
        except ValueError:
            return False
    return True


def _outcomes(
    options: BatchOptions, jobs: Sequence[Job], bars: "_ProgressBars", opened: ExitStack
) -> Iterator[Outcome]:
    processes = options.jobs or os.cpu_count() or 1
    if options.ray is None:
        return run_locally(jobs, processes, bars.advance)
    from manipnet_tools.batch.cluster import cluster, run_on_cluster

    processors = opened.enter_context(cluster(options.ray, processes))
    return run_on_cluster(jobs, processors, bars.advance)


def table(outcomes: Sequence[Outcome]) -> Table:
    """One line per take. The reason of a failure stands beside the take, and is broken rather than cut."""
    lines = Table()
    lines.add_column("take", overflow="fold")
    lines.add_column("result", no_wrap=True)
    if any(outcome.reason for outcome in outcomes):
        lines.add_column("reason", overflow="fold")
    for title in ("length", "took", "speed"):
        lines.add_column(title, justify="right", no_wrap=True)
    for outcome in outcomes:
        length_s = outcome.frames / TICK_HZ
        state = Text("up to date" if outcome.state == "skipped" else outcome.state, COLOURS[outcome.state])
        reason = [outcome.reason] if len(lines.columns) == 6 else []
        is_done = outcome.state == "done"
        lines.add_row(
            outcome.name,
            state,
            *reason,
            f"{length_s:.1f} s" if outcome.frames else "",
            f"{outcome.seconds:.1f} s" if is_done else "",
            f"{length_s / outcome.seconds:.1f}x" if is_done else "",
        )
    return lines


class _ProgressBars:
    """A progress bar for all takes, and one for each take in progress."""

    def __init__(self, console: Console, takes: int) -> None:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._progress = Progress(*columns, console=console)
        self._all = self._progress.add_task("takes", total=takes)
        self._takes: dict[str, TaskID] = {}

    def __enter__(self) -> "_ProgressBars":
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
            self._progress.print(f"{outcome.name} failed: {outcome.reason}")
