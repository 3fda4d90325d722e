"""`manipnet evaluate --sweep NAME`: how the hands change with what a live session does to their input.

Each sweep changes the input of the synthesis and compares the result with the unchanged take, on its last 20 %. Only
`scale` changes the comparison too, because a larger object has other gaps, another inertia and another table height.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh

from manipnet import geometry
from manipnet.geometry import Array, Side
from manipnet.synthesis.model.bundle import Bundle
from manipnet.synthesis.objects.mesh import closed_mesh
from manipnet.synthesis.objects.shape import Shape, build_shape
from manipnet.synthesis.synthesizer import Synthesizer
from manipnet.tracking.tick import TICK_HZ
from manipnet_tools.evaluation import baselines, physics
from manipnet_tools.evaluation.cases import SEEN_SHARE, Case, load_case
from manipnet_tools.evaluation.judge import Judge
from manipnet_tools.evaluation.roll_outs import synthesise
from manipnet_tools.evaluation.scoring import Score, average
from manipnet_tools.takes.dataset import take_folders
from manipnet_tools.takes.rollout import HandInput, hand_inputs, roll_out, tick_take
from manipnet_tools.takes.take import BodyTrack, Take, read_take

Change = Callable[[Take, Case], Case]
"""From a take and its case to a case of the same length with other input."""

LOOP_S = 600.0


@dataclass(frozen=True)
class Subject:
    """A take that is tested, and its case."""

    take: Take
    case: Case


def load_subjects(data: Path, names: tuple[str, ...] = ()) -> list[Subject]:
    """The takes of the dataset folder with their cases. Raises `DataError`."""
    takes = [read_take(folder) for folder in take_folders(data, names)]
    return [Subject(take, load_case(take, data)) for take in takes]


def hand_ticks(name: str, subjects: list[Subject]) -> int:
    """The number of hand-ticks of a sweep."""
    if name == "loop":
        return 2 * int(LOOP_S * TICK_HZ)
    return 2 * len(CHANGES[name]) * sum(len(subject.case.part(SEEN_SHARE, 1.0)) for subject in subjects)


def sweep(
    name: str, subjects: list[Subject], bundle: Bundle, solver: str, advance: Callable[[int], None]
) -> Iterator[tuple[str, Score]]:
    """Each step of a sweep with the average score over takes and hands; `loop` uses only the first take."""
    mean = baselines.mean_pose([subject.case.part(0.0, SEEN_SHARE) for subject in subjects])
    if name == "loop":
        yield from _loop(subjects[0].case.part(SEEN_SHARE, 1.0), mean, bundle, solver, advance)
        return
    for step, change in CHANGES[name].items():
        cases = [change(subject.take, subject.case).part(SEEN_SHARE, 1.0) for subject in subjects]
        hands = synthesise(bundle, solver, cases, advance)
        scores = [Judge(case, mean, ("scores",))(of).values() for case, of in zip(cases, hands, strict=True)]
        yield step, average(one for sides in scores for one in sides)


def noise(position_m: float, angle_rad: float) -> Change:
    """White noise on every tracked pose: standard deviations per axis."""

    def change(take: Take, case: Case) -> Case:
        rng = np.random.default_rng(0)
        bodies = {name: _shaken(track, position_m, angle_rad, rng) for name, track in take.bodies.items()}
        return replace(case, inputs=_inputs(replace(take, bodies=bodies), case))

    return change


def _shaken(track: BodyTrack, position_m: float, angle_rad: float, rng: np.random.Generator) -> BodyTrack:
    shake = rng.normal(size=(len(track.poses), 6)) * np.repeat([position_m, angle_rad], 3)
    turned = geometry.quat_multiply(geometry.quat_exp(shake[:, 3:]), track.poses[:, 3:])
    return BodyTrack(np.concatenate([track.poses[:, :3] + shake[:, :3], turned], axis=1), track.tracked)


def look_ahead(seconds: float) -> Change:
    """The future is forecast from `seconds` on."""
    return lambda take, case: replace(case, inputs=_inputs(take, case, seconds))


def _inputs(take: Take, case: Case, look_ahead_s: float = 0.5) -> dict[Side, HandInput]:
    ticks = tick_take(take, look_ahead_s)[: len(case)]
    return hand_inputs(ticks, {case.object: case.shape})


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


CHANGES: dict[str, dict[str, Change]] = {
    "noise": {
        f"{mm:g} mm, {degrees:g}°": noise(1e-3 * mm, np.radians(degrees))
        for mm, degrees in ((0, 0), (0.25, 0.1), (0.5, 0.25), (1, 0.5), (2, 0), (0, 1), (2, 1))
    },
    "look-ahead": {f"{seconds:g} s": look_ahead(seconds) for seconds in (0.5, 0.4, 0.3, 0.2, 0.1, 0.05, 0.0)},
    "resolution": {f"{count} triangles": resolution(count) for count in (500, 2000, 10_000, 100_000)},
    "scale": {f"{factor:g} times": scale(factor) for factor in (0.7, 0.85, 1.0, 1.2, 1.4)},
}


def _loop(
    case: Case, mean: Array, bundle: Bundle, solver: str, advance: Callable[[int], None]
) -> Iterator[tuple[str, Score]]:
    """Ten minutes of one case, played forwards and backwards without a restart, and scored pass by pass."""
    both_ways = 2 * len(case)
    frames = int(LOOP_S * TICK_HZ)
    at = np.resize([*range(len(case)), *reversed(range(len(case)))], frames)
    forwards = np.resize([True] * len(case) + [False] * len(case), frames)
    inputs = [forwards_and_backwards(seen, at, forwards) for seen in case.inputs.values()]
    motions = roll_out(Synthesizer(bundle, solver), inputs, advance)
    for start in range(0, frames - len(case), both_ways):
        positions = [motion.positions[start : start + len(case)] for motion in motions]
        hands = dict(zip(case.inputs, positions, strict=True))
        yield f"from {start / TICK_HZ:.0f} s", average(Judge(case, mean, ("scores",))(hands).values())


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
