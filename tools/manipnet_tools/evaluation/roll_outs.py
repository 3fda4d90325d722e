"""Makes the rows of an evaluation: models rolled out on takes, and hands that need no network."""

from collections.abc import Callable, Collection, Container, Sequence
from dataclasses import replace
from itertools import groupby

from rich.progress import Progress

from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.model.bundle import Bundle, load_bundle
from manipnet.synthesis.synthesizer import Synthesizer
from manipnet_tools.evaluation import baselines
from manipnet_tools.evaluation.baselines import held
from manipnet_tools.evaluation.cases import SEEN_SHARE, Case
from manipnet_tools.evaluation.judge import Judge
from manipnet_tools.evaluation.options import EvaluationProtocol, MeasureGroup
from manipnet_tools.evaluation.results import (
    CAPTURED,
    HOLD,
    MEAN,
    NEAREST,
    Fold,
    Hands,
    Results,
    Row,
    row_name,
)
from manipnet_tools.takes.bone_frames import in_frames_of, same_joints
from manipnet_tools.takes.rollout import roll_out

Source = Callable[[Fold, Callable[[int], None]], list[Hands]]
"""Makes the hands of one row for each test case of a fold; it may report the number of hand-ticks done."""


def folds(cases: Sequence[Case], protocol: EvaluationProtocol, takes: Container[str]) -> list[Fold]:
    """The folds of a protocol, of which only `takes` are tested.

    `seen` tests the last fifth of every take. `unseen` tests each take in turn and trains on the takes of other
    objects.
    """
    tested = [case for case in cases if case.name in takes]
    if protocol == "seen":
        train = [case.part(0.0, SEEN_SHARE) for case in cases]
        return [Fold("seen", train, [case.part(SEEN_SHARE, 1.0) for case in tested])]
    return [Fold(case.name, [other for other in cases if other.object != case.object], [case]) for case in tested]


def evaluate(
    folds: Sequence[Fold],
    protocol: EvaluationProtocol,
    sources: dict[str, Source],
    progress: Progress,
    groups: Collection[MeasureGroup] = ("scores",),
) -> Results:
    """Judge the captured fingers, the mean pose and the hands of every source, by name, on every fold."""
    rows: dict[str, Row] = {}
    task = progress.add_task(protocol, total=len(sources) * sum(map(_hand_ticks, folds)))
    for fold in folds:
        mean = baselines.mean_pose(fold.train)
        hands = {CAPTURED: [case.captured for case in fold.test], MEAN: [held(case, mean) for case in fold.test]}
        for name, source in sources.items():
            done = progress.tasks[task].completed
            hands[name] = source(fold, lambda n: progress.advance(task, n))
            progress.update(task, completed=done + _hand_ticks(fold))
        for k, case in enumerate(fold.test):
            judge = Judge(case, mean, groups)
            drops = progress.add_task(f"drop {case.name}", total=judge.drops * len(hands), visible=judge.drops > 0)
            for name, of_cases in hands.items():
                row = rows.setdefault(name, Row())
                row.hands[case.name] = of_cases[k]
                row.scores[case.name] = judge(of_cases[k], lambda n, drops=drops: progress.advance(drops, n))
    return Results(protocol, {case.name: case for fold in folds for case in fold.test}, rows)


def _hand_ticks(fold: Fold) -> int:
    return 2 * sum(map(len, fold.test))


def model_rows(models: dict[str, Callable[[Fold], Bundle]], solvers: Sequence[str]) -> dict[str, Source]:
    """A row for every model with every solver."""
    return {
        row_name(name, solver): lambda fold, advance, model=model, solver=solver: synthesise(
            model(fold), solver, fold.test, advance
        )
        for name, model in models.items()
        for solver in solvers
    }


def baseline_rows(model: Callable[[Fold], Bundle]) -> dict[str, Source]:
    """The fingers of the nearest training frame, and the neutral pose of a model for every frame."""

    def nearest(fold: Fold, advance: Callable[[int], None]) -> list[Hands]:
        bundle = model(fold)
        retrieve = baselines.Retrieval(fold.train, bundle.hand, Synthesizer(bundle).rest_state())
        return [retrieve(case) for case in fold.test]

    def hold(fold: Fold, advance: Callable[[int], None]) -> list[Hands]:
        rest = Synthesizer(model(fold)).rest_state()
        return [held(case, rest.positions) for case in fold.test]

    return {NEAREST: nearest, HOLD: hold}


def posing(bundle: Bundle, hand: Hand) -> Bundle:
    """The bundle with the hand that it shall pose in place of its own, if that is another one.

    Hands are compared in their relaxed poses. That of the dataset's subject is known from the shipped bundle; a
    generated hand has the angles of its model.
    """
    if same_joints(hand, bundle.hand):
        return bundle
    own, subject = bundle.rest_angles, load_bundle()
    rest = subject.rest_angles if same_joints(hand, subject.hand) else own
    shifted = bundle.limits + (rest - own)[:, None]
    return replace(bundle, hand=in_frames_of(hand, bundle.hand, rest, own), rest_angles=rest, limits=shifted)


def synthesise(
    bundle: Bundle, solver: str, cases: Sequence[Case], advance: Callable[[int], None] = lambda n: None
) -> list[Hands]:
    """Roll out both hands of all cases from the neutral pose; returns joints in the canonical wrist frame.

    The network poses the hand that was captured, so that joint errors tell how well it poses hands and not how long
    its own fingers are.
    """
    results = []
    for _, same in groupby(cases, lambda case: case.hand.packed.tobytes()):
        of_hand = list(same)
        inputs = [case.inputs for case in of_hand]
        synthesizer = Synthesizer(posing(bundle, of_hand[0].hand), solver)
        motions = iter(roll_out(synthesizer, [seen for of in inputs for seen in of.values()], advance))
        results += [{side: next(motions).positions for side in of} for of in inputs]
    return results
