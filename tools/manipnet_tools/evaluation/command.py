"""`manipnet evaluate`: roll-outs on held-out takes, compared with captured fingers and with hands without a network."""

import importlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from manipnet.synthesis.model.bundle import Bundle, load_bundle
from manipnet_tools.evaluation import report
from manipnet_tools.evaluation.cases import load_cases
from manipnet_tools.evaluation.finger_files import finger_files, fingers_of
from manipnet_tools.evaluation.options import EvaluateOptions, Sweep
from manipnet_tools.evaluation.realism import realism
from manipnet_tools.evaluation.results import FINGERS, Fold, row_name
from manipnet_tools.evaluation.roll_outs import Source, baseline_rows, evaluate, folds, model_rows
from manipnet_tools.takes.dataset import take_folders
from manipnet_tools.terminal import open_console


def run(options: EvaluateOptions) -> None:
    """Evaluate, print the tables and write the requested files.

    Raises `DataError`, `TakeError`, `MeshError` and `BundleError`.
    """
    console = open_console(stderr=False)
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console) as progress:
        if options.sweep:
            content, shown = _sweep(options, options.sweep, progress)
        else:
            content, shown = _protocol(options, progress)
    for table in shown:
        console.print(table)
    if options.json:
        options.json.write_text(json.dumps(content, indent=1))


def _protocol(options: EvaluateOptions, progress: Progress) -> tuple[dict[str, Any], list[Table]]:
    if "drop" in options.only:
        importlib.import_module("mujoco")  # or its absence would be noticed only after the roll-outs
    cases = load_cases(options.data)
    files = finger_files(options.fingers, [case.name for case in cases])
    takes = [folder.name for folder in take_folders(options.data, tuple(files) or options.takes)]
    tests = folds(cases, options.protocol, takes)
    sources = {FINGERS: fingers_of(files)} if files else _model_sources(options)
    ours = FINGERS if files else next(iter(sources))
    results = evaluate(tests, options.protocol, sources, progress, options.only)
    if options.plots:
        from manipnet_tools.evaluation import plots

        for path in progress.track(list(plots.write_all(results, ours, options.plots)), description="plots"):
            progress.console.print(f"wrote {path}")
    if options.sheet:
        from manipnet_tools.evaluation.sheet import write_sheet

        answers = write_sheet(results, ours, options.sheet)
        progress.console.print(f"wrote {options.sheet}; {answers} says which pictures are captured")
    compared = realism(results) if "realism" in options.only else {}
    return report.as_json(results, ours, compared), list(report.tables(results, ours, compared))


def _model_sources(options: EvaluateOptions) -> dict[str, Source]:
    models = _models(options)
    sources = model_rows(models, options.solver)
    return sources | baseline_rows(next(iter(models.values()))) if "scores" in options.only else sources


def _sweep(options: EvaluateOptions, name: Sweep, progress: Progress) -> tuple[dict[str, Any], list[Table]]:
    from manipnet_tools.evaluation import sweeps

    model, of_fold = next(iter(_models(options).items()))
    subjects = sweeps.load_subjects(options.data, options.protocol, options.takes, of_fold)
    task = progress.add_task(name, total=sweeps.hand_ticks(name, subjects))
    steps = sweeps.sweep(name, subjects, options.solver[0], lambda n: progress.advance(task, n))
    rows = dict(steps)
    if options.plots:
        from manipnet_tools.evaluation import plots

        progress.console.print(f"wrote {plots.write_sweep(name, rows, options.plots)}")
    tested = "last 20 % of" if options.protocol == "seen" else "all of"
    title = f"{name}: {row_name(model, options.solver[0])}, {tested} {len(subjects)} takes"
    return {"sweep": name, "rows": report.plain(rows)}, [report.table_of(title, rows)]


def _models(options: EvaluateOptions) -> dict[str, Callable[[Fold], Bundle]]:
    if options.protocol == "seen":
        bundles = [load_bundle(model) for model in options.model]
        return {bundle.name: lambda fold, bundle=bundle: bundle for bundle in bundles}
    return {
        folder.name: lambda fold, folder=folder: _left_out(folder / fold.name, fold, options.data)
        for folder in options.models_dir
    }


def _left_out(folder: Path, fold: Fold, data: Path) -> Bundle:
    """The bundle of a fold, which is trained first if it does not exist."""
    if not (folder / "bundle.json").is_file():
        from manipnet_tools.training.config import TrainConfig
        from manipnet_tools.training.dataset import TakeSet, load_captured_hands
        from manipnet_tools.training.train import train
        from manipnet_tools.training.trained import save_bundle

        hands = load_captured_hands(data, [case.name for case in fold.train])
        save_bundle(train([TakeSet(hands)], TrainConfig()), folder)
    return load_bundle(folder)
