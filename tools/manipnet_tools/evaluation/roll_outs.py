"""What makes the rows of an evaluation: models rolled out on takes."""

from collections.abc import Callable, Container, Iterator, Sequence

from rich.progress import Progress

from manipnet.geometry import Array
from manipnet.synthesis.model.bundle import Bundle
from manipnet.synthesis.synthesizer import Synthesizer
from manipnet_tools.evaluation import baselines
from manipnet_tools.evaluation.cases import SEEN_SHARE, Case
from manipnet_tools.evaluation.results import (
    CAPTURED,
    HOLD,
    MEAN,
    NEAREST,
    Fold,
    Hands,
    Protocol,
    Results,
    Row,
    row_name,
)
from manipnet_tools.evaluation.scoring import score
from manipnet_tools.takes.rollout import roll_out


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
    solvers: Sequence[str],
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
    solvers: Sequence[str],
    advance: Callable[[int], None],
) -> Iterator[tuple[str, Case, Hands]]:
    bundles = {name: model(fold) for name, model in models.items()}
    first = next(iter(bundles.values()))
    rest = Synthesizer(first).rest_state()
    retrieve = baselines.Retrieval(fold.train, first.hand, rest)
    for case in fold.test:
        yield CAPTURED, case, case.captured
        yield MEAN, case, baselines.held(case, mean)
        yield NEAREST, case, retrieve(case)
        yield HOLD, case, baselines.held(case, rest.positions)
    for name, bundle in bundles.items():
        for solver in solvers:
            for case, hands in zip(fold.test, synthesise(bundle, solver, fold.test, advance), strict=True):
                yield row_name(name, solver), case, hands


def synthesise(
    bundle: Bundle, solver: str, cases: Sequence[Case], advance: Callable[[int], None] = lambda n: None
) -> list[Hands]:
    """Roll out both hands of all cases from the neutral pose: joints in the canonical wrist frame."""
    inputs = [case.inputs for case in cases]
    motions = iter(roll_out(Synthesizer(bundle, solver), [seen for of in inputs for seen in of.values()], advance))
    return [{side: next(motions).positions for side in of} for of in inputs]
