"""`manipnet evaluate`: roll-outs on held-out takes, compared with captured fingers and with hands without a network."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from manipnet.synthesis.model.bundle import Bundle, load_bundle
from manipnet_tools.evaluation import report
from manipnet_tools.evaluation.cases import load_cases
from manipnet_tools.evaluation.options import EvaluateOptions, Sweep
from manipnet_tools.evaluation.results import Fold, row_name
from manipnet_tools.evaluation.roll_outs import evaluate, folds
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
    models = _models(options)
    cases = load_cases(options.data)
    takes = [folder.name for folder in take_folders(options.data, options.takes)]
    tests = folds(cases, options.protocol, takes)
    results = evaluate(tests, options.protocol, models, options.solver, progress)
    ours = row_name(next(iter(models)), options.solver[0])
    if options.plots:
        from manipnet_tools.evaluation import plots

        for path in progress.track(list(plots.write_all(results, ours, options.plots)), description="plots"):
            progress.console.print(f"wrote {path}")
    return report.as_json(results, ours), list(report.tables(results, ours))


def _sweep(options: EvaluateOptions, name: Sweep, progress: Progress) -> tuple[dict[str, Any], list[Table]]:
    from manipnet_tools.evaluation import sweeps

    bundle = load_bundle(options.model[0])
    subjects = sweeps.load_subjects(options.data, options.takes)
    task = progress.add_task(name, total=sweeps.hand_ticks(name, subjects))
    steps = sweeps.sweep(name, subjects, bundle, options.solver[0], lambda n: progress.advance(task, n))
    rows = dict(steps)
    if options.plots:
        from manipnet_tools.evaluation import plots

        progress.console.print(f"wrote {plots.write_sweep(name, rows, options.plots)}")
    title = f"{name}: {row_name(bundle.name, options.solver[0])}, last 20 % of {len(subjects)} takes"
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
        from manipnet_tools.training.dataset import load_captured_hands
        from manipnet_tools.training.train import train
        from manipnet_tools.training.trained import save_bundle

        hands = load_captured_hands(data, [case.name for case in fold.train])
        save_bundle(train(hands, TrainConfig()), folder)
    return load_bundle(folder)
