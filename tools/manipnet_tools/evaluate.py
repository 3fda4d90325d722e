"""`manipnet evaluate`: roll-outs on held-out takes, beside captured fingers and hands without a network."""

import json
from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from manipnet.geometry import Array
from manipnet.network.bundle import DEFAULT_MODEL, Bundle, load_bundle
from manipnet.synthesis import Side, SolverName, Synthesizer
from manipnet_tools import baselines, report
from manipnet_tools.cases import SEEN_SHARE, Case, data_folders, load_cases
from manipnet_tools.rollout import roll_out
from manipnet_tools.scoring import Score, average, score

Protocol = Literal["seen", "unseen"]
Sweep = Literal["noise", "look-ahead", "resolution", "scale", "loop"]
Hands = dict[Side, Array]
CAPTURED, MEAN, NEAREST, HOLD = "captured fingers", "mean pose", "nearest frame", "hold"


@dataclass(frozen=True)
class Fold:
    """What a model may have been trained on and what it is tested on."""

    name: str
    """The take left out, or `seen`."""
    train: list[Case]
    test: list[Case]


@dataclass(frozen=True)
class Row:
    """One kind of hands on every test case: joints in the canonical wrist frame and their scores."""

    hands: dict[str, Hands] = field(default_factory=dict)
    scores: dict[str, dict[Side, Score]] = field(default_factory=dict)

    @property
    def average(self) -> Score:
        """Over takes and both hands."""
        return average(score for sides in self.scores.values() for score in sides.values())


@dataclass(frozen=True)
class Results:
    """All rows of one protocol; `cases` are what was tested, by name."""

    protocol: Protocol
    cases: dict[str, Case]
    rows: dict[str, Row]


def folds(cases: Sequence[Case], protocol: Protocol, takes: Container[str]) -> list[Fold]:
    """`seen`: the last fifth of every take; `unseen`: each take in turn, its object in no other. Tests `takes` only."""
    tested = [case for case in cases if case.name in takes]
    if protocol == "seen":
        train = [case.part(0.0, SEEN_SHARE) for case in cases]
        return [Fold("seen", train, [case.part(SEEN_SHARE, 1.0) for case in tested])]
    return [Fold(case.name, [other for other in cases if other.object != case.object], [case]) for case in tested]


def evaluate(
    folds: Sequence[Fold],
    protocol: Protocol,
    models: dict[str, Callable[[Fold], Bundle]],
    solvers: Sequence[SolverName],
    progress: Progress,
) -> Results:
    """Test every model, with every solver, and the baselines on every fold.

    The neutral pose of the first model is the row `hold`.
    """
    rows: dict[str, Row] = {}
    task = progress.add_task(protocol, total=_hand_ticks(folds, len(models) * len(solvers)))
    for fold in folds:
        mean = baselines.mean_pose(fold.train)
        for name, case, hands in _all_hands(fold, mean, models, solvers, lambda n: progress.advance(task, n)):
            row = rows.setdefault(name, Row())
            row.hands[case.name], row.scores[case.name] = hands, score(case, mean, hands)
    return Results(protocol, {case.name: case for fold in folds for case in fold.test}, rows)


def _hand_ticks(folds: Sequence[Fold], variants: int) -> int:
    return 2 * variants * sum(len(case) for fold in folds for case in fold.test)


def _all_hands(
    fold: Fold,
    mean: Array,
    models: dict[str, Callable[[Fold], Bundle]],
    solvers: Sequence[SolverName],
    advance: Callable[[int], None],
) -> Iterator[tuple[str, Case, Hands]]:
    bundles = {name: model(fold) for name, model in models.items()}
    rest = Synthesizer(next(iter(bundles.values()))).rest_state()
    retrieve = baselines.Retrieval(fold.train, rest)
    for case in fold.test:
        yield CAPTURED, case, case.captured
        yield MEAN, case, baselines.held(case, mean)
        yield NEAREST, case, retrieve(case)
        yield HOLD, case, baselines.held(case, rest.positions)
    for name, bundle in bundles.items():
        for solver in solvers:
            for case, hands in zip(fold.test, synthesise(bundle, solver, fold.test, advance), strict=True):
                yield row_name(name, solver), case, hands


def row_name(model: str, solver: SolverName) -> str:
    """What the row of a model with a solver is called."""
    return f"{model}, no IK" if solver == "none" else f"{model}, {solver.replace('_', ' ')}"


def synthesise(
    bundle: Bundle, solver: SolverName, cases: Sequence[Case], advance: Callable[[int], None] = lambda n: None
) -> list[Hands]:
    """Roll out both hands of all cases from the neutral pose: joints in the canonical wrist frame."""
    inputs = [case.inputs for case in cases]
    motions = iter(roll_out(Synthesizer(bundle, solver), [seen for of in inputs for seen in of.values()], advance))
    return [{side: next(motions).positions for side in of} for of in inputs]


@dataclass(frozen=True)
class EvaluateOptions:
    """Judge models on the dataset's takes: tables in the terminal, and JSON and plots where asked for."""

    data: Path
    """The dataset's folder, with BVH/ and meshes/."""
    model: tuple[str, ...] = (DEFAULT_MODEL,)
    """For --protocol seen: bundles trained on the first 80 % of every take, by shipped name or folder."""
    models_dir: tuple[Path, ...] = (Path("unseen"),)
    """For --protocol unseen: folders of bundles, each bundle named by the take left out of its training. Those that
    are missing are trained, which takes long, and kept there."""
    protocol: Protocol = "seen"
    """seen: the last 20 % of every take. unseen: every take with a model that has not seen its object."""
    solver: tuple[SolverName, ...] = ("least_squares", "none")
    """Solvers to test each model with."""
    takes: tuple[str, ...] = ()
    """Test only these takes; all by default."""
    sweep: Sweep | None = None
    """Instead: how the last 20 % bears noise, a shorter look-ahead, other meshes, other sizes, ten minutes."""
    json: Path | None = None
    """Write every figure to this file."""
    plots: Path | None = None
    """Write plots and pictures of the worst frames into this folder."""


def run(options: EvaluateOptions) -> None:
    """Evaluate, print the tables, write what was asked for. Raises `DataError` and `BundleError`."""
    console = Console()
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
    takes = [folder.name for folder in data_folders(options.data, options.takes)]
    tests = folds(cases, options.protocol, takes)
    results = evaluate(tests, options.protocol, models, options.solver, progress)
    ours = row_name(next(iter(models)), options.solver[0])
    if options.plots:
        from manipnet_tools import plots

        for path in progress.track(list(plots.write_all(results, ours, options.plots)), description="plots"):
            progress.console.print(f"wrote {path}")
    return report.as_json(results, ours), list(report.tables(results, ours))


def _sweep(options: EvaluateOptions, name: Sweep, progress: Progress) -> tuple[dict[str, Any], list[Table]]:
    from manipnet_tools import sweeps

    bundle = load_bundle(options.model[0])
    subjects = sweeps.load_subjects(options.data, options.takes)
    task = progress.add_task(name, total=sweeps.hand_ticks(name, subjects))
    steps = sweeps.sweep(name, subjects, bundle, options.solver[0], lambda n: progress.advance(task, n))
    rows = dict(steps)
    if options.plots:
        from manipnet_tools import plots

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
    """The bundle of a fold, trained first if it is not there."""
    if not (folder / "bundle.json").is_file():
        from manipnet_tools import dataset, train

        tracks = dataset.load_tracks(data, [case.name for case in fold.train])
        train.save_bundle(train.train(tracks, train.TrainConfig()), folder)
    return load_bundle(folder)
