"""`manipnet evaluate --sweep NAME`: how the hands change with what a live session does to their input.

Each sweep changes the input of the synthesis and compares the result with the unchanged take. Only `scale` changes the
comparison too, because a larger object has other gaps, another inertia and another table height.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import trimesh

from manipnet.geometry import Array
from manipnet.synthesis.model.bundle import Bundle
from manipnet.synthesis.model.providers import MAX_LOOK_AHEAD_S
from manipnet.synthesis.objects.mesh import closed_mesh
from manipnet.synthesis.objects.shape import Shape, build_shape
from manipnet.synthesis.synthesizer import Synthesizer
from manipnet.tracking.tick import TICK_HZ
from manipnet_tools.evaluation import baselines, physics
from manipnet_tools.evaluation.cases import SEEN_SHARE, Case, load_case
from manipnet_tools.evaluation.judge import Judge
from manipnet_tools.evaluation.options import EvaluationProtocol
from manipnet_tools.evaluation.results import Fold
from manipnet_tools.evaluation.roll_outs import folds, synthesise
from manipnet_tools.evaluation.scoring import Score, average
from manipnet_tools.takes.dataset import take_folders
from manipnet_tools.takes.rollout import HandInput, hand_inputs, roll_out, tick_take
from manipnet_tools.takes.take import Take, read_take
from manipnet_tools.takes.tracker import Tracker, tracked_by

Change = Callable[[Take, Case], Case]
"""From a take and its case to a case with other input, which is at most as long."""

LOOP_S = 600.0


@dataclass(frozen=True)
class Subject:
    """A take that is tested, its whole case, and the model and mean pose that are compared on the tested stretch."""

    take: Take
    case: Case
    bundle: Bundle
    mean: Array
    start: float
    """The share of the take, from its start, that is not tested."""

    def tested(self, case: Case) -> Case:
        """The tested stretch of a version of the whole case."""
        return case.part(self.start, 1.0)


def load_subjects(
    data: Path, protocol: EvaluationProtocol, names: tuple[str, ...], model: Callable[[Fold], Bundle]
) -> list[Subject]:
    """The takes of the dataset folder, or those named, with the model of their fold. Raises `DataError`."""
    takes = {folder.name: read_take(folder) for folder in take_folders(data)}
    cases = {name: load_case(take, data) for name, take in takes.items()}
    tests = folds(list(cases.values()), protocol, [folder.name for folder in take_folders(data, names)])
    start = SEEN_SHARE if protocol == "seen" else 0.0
    return [
        Subject(takes[test.name], cases[test.name], model(fold), baselines.mean_pose(fold.train), start)
        for fold in tests
        for test in fold.test
    ]


def hand_ticks(name: str, subjects: list[Subject]) -> int:
    """The number of hand-ticks of a sweep, or slightly more."""
    if name == "loop":
        return 2 * int(LOOP_S * TICK_HZ)
    return 2 * len(CHANGES[name]) * sum(len(subject.tested(subject.case)) for subject in subjects)


def sweep(
    name: str, subjects: list[Subject], solver: str, advance: Callable[[int], None]
) -> Iterator[tuple[str, Score]]:
    """Each step of a sweep with the average score over takes and hands; `loop` uses only the first take."""
    if name == "loop":
        yield from _loop(subjects[0], solver, advance)
        return
    for step, change in CHANGES[name].items():
        scores: list[Score] = []
        for subject in subjects:
            case = subject.tested(change(subject.take, subject.case))
            (hands,) = synthesise(subject.bundle, solver, [case], advance)
            scores += Judge(case, subject.mean, ("scores",))(hands).values()
        yield step, average(scores)


def tracked(tracker: Tracker, look_ahead_s: float = MAX_LOOK_AHEAD_S) -> Change:
    """The bodies are tracked by another system, and the future is forecast from `look_ahead_s` on."""
    return lambda take, case: _with_inputs(tracked_by(tracker, take), case, look_ahead_s)


def noise(position_m: float, angle_rad: float) -> Change:
    """White noise on every tracked pose: standard deviations per axis."""
    return tracked(Tracker(position_m, angle_rad))


def look_ahead(seconds: float) -> Change:
    """The future is forecast from `seconds` on."""
    return lambda take, case: _with_inputs(take, case, seconds)


def _with_inputs(take: Take, case: Case, look_ahead_s: float) -> Case:
    """The case with the bodies of another version of its take, as far as that goes."""
    ticks = tick_take(take, look_ahead_s)[: len(case)]
    return replace(case[: len(ticks.time_s)], inputs=hand_inputs(ticks, {case.object: case.shape}))


def resolution(triangles: int) -> Change:
    """The object's mesh has about this many triangles."""

    def change(take: Take, case: Case) -> Case:
        shape = remeshed(case.shape, triangles)
        return replace(case, inputs={side: replace(seen, shapes=(shape,)) for side, seen in case.inputs.items()})

    return change


def remeshed(shape: Shape, triangles: int) -> Shape:
    """The same surface in fewer (within a growing tolerance) or more triangles (split edges)."""
    from manifold3d import Manifold, Mesh

    mesh = shape.mesh
    if len(mesh.faces) > triangles:
        solid = Manifold(Mesh(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32)))
        tolerance = 1e-5
        while solid.num_tri() > triangles and tolerance < 0.02:
            solid, tolerance = solid.simplify(tolerance), 1.3 * tolerance
        thin = solid.to_mesh()
        vertices, faces = np.asarray(thin.vert_properties)[:, :3], np.asarray(thin.tri_verts)
    else:
        vertices, faces = mesh.vertices, mesh.faces
        while 2 * len(faces) <= triangles:
            vertices, faces = trimesh.remesh.subdivide(vertices, faces)[:2]
    return build_shape(closed_mesh(vertices, faces, f"{mesh.name}-{len(faces)}"))


def scale(factor: float) -> Change:
    """The object is `factor` times as large about its own origin; the hands stay where they were."""

    def change(take: Take, case: Case) -> Case:
        mesh = case.shape.mesh
        shape = build_shape(closed_mesh(factor * mesh.vertices, mesh.faces, mesh.name))
        body, poses = physics.body_of(shape), case.T_world_object
        return replace(
            case,
            shape=shape,
            inputs={side: replace(seen, scale=factor) for side, seen in case.inputs.items()},
            needed=physics.wrench_needed(poses, body),
            needed_paper=physics.wrench_needed(poses, body, physics.PAPER),
            lifted=physics.lifted(poses, body),
        )

    return change


TRACKERS: Final = {
    "clean": Tracker(),
    "0.1 mm, 0.05°": Tracker(1e-4, np.radians(0.05)),
    "1 mm, 0.5°": Tracker(1e-3, np.radians(0.5)),
    "2 mm, 1°, 90 Hz, lost": Tracker(2e-3, np.radians(1.0), rate_hz=90.0, jitter_s=1e-3, losses=0.005),
}
"""From a studio's system to the trackers of a headset."""

CHANGES: dict[str, dict[str, Change]] = {
    "noise": {
        f"{mm:g} mm, {degrees:g}°": noise(1e-3 * mm, np.radians(degrees))
        for mm, degrees in ((0, 0), (0.25, 0.1), (0.5, 0.25), (1, 0.5), (2, 0), (0, 1), (2, 1))
    },
    "tracker": {
        f"{name}, {seconds:g} s": tracked(tracker, seconds)
        for name, tracker in TRACKERS.items()
        for seconds in (0.5, 0.25, 0.1, 0.0)
    },
    "look-ahead": {f"{seconds:g} s": look_ahead(seconds) for seconds in (0.5, 0.4, 0.3, 0.2, 0.1, 0.05, 0.0)},
    "resolution": {f"{count} triangles": resolution(count) for count in (500, 2000, 10_000, 100_000)},
    "scale": {f"{factor:g} times": scale(factor) for factor in (0.7, 0.85, 1.0, 1.2, 1.4)},
}


def _loop(subject: Subject, solver: str, advance: Callable[[int], None]) -> Iterator[tuple[str, Score]]:
    """Ten minutes of one case, played forwards and backwards without a restart, and scored pass by pass."""
    case = subject.tested(subject.case)
    both_ways = 2 * len(case)
    frames = int(LOOP_S * TICK_HZ)
    at = np.resize([*range(len(case)), *reversed(range(len(case)))], frames)
    forwards = np.resize([True] * len(case) + [False] * len(case), frames)
    inputs = [forwards_and_backwards(seen, at, forwards) for seen in case.inputs.values()]
    motions = roll_out(Synthesizer(subject.bundle, solver), inputs, advance)
    for start in range(0, frames - len(case), both_ways):
        positions = [motion.positions[start : start + len(case)] for motion in motions]
        hands = dict(zip(case.inputs, positions, strict=True))
        yield f"from {start / TICK_HZ:.0f} s", average(Judge(case, subject.mean, ("scores",))(hands).values())


def forwards_and_backwards(seen: HandInput, at: np.ndarray, forwards: np.ndarray) -> HandInput:
    """The ticks `at (n,)` of an input; time runs backwards where `forwards (n,)` is false."""

    def play(windows: Array) -> Array:
        return np.where(forwards[:, None, None], windows[at], windows[at, ::-1])

    return replace(
        seen,
        wrist=play(seen.wrist),
        other_wrist=play(seen.other_wrist),
        object=play(seen.object),
        held=seen.held[at],
    )
