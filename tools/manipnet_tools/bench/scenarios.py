"""The motion on which ticks are timed: the bundled demo or any take, without an end, for any number of actors."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from manipnet.config.settings import WRISTS, ActorConfig, BodyConfig, ObjectConfig
from manipnet.demo.player import DEMO_FILE, DEMO_OBJECTS
from manipnet.synthesis.objects.library import LIBRARY_FOLDER
from manipnet.synthesis.objects.shape import Shape, load_shape
from manipnet.wire.bodies import BodyFrame
from manipnet_tools.commands.replay import resample, take_frames
from manipnet_tools.takes.take import TakeError, read_take

APART = 0.37
"""Each actor is ahead of the previous one by this share of the scenario, so that no two do the same."""


@dataclass(frozen=True)
class Scenario:
    """Frames at a constant rate, and the mesh file and shape of every prop in them."""

    name: str
    rate_hz: float
    frames: Sequence[BodyFrame]
    meshes: Mapping[str, Path]
    shapes: Mapping[str, Shape]

    def with_shape(self, shape: Shape) -> "Scenario":
        """The same motion with another shape for every prop."""
        return replace(self, shapes=dict.fromkeys(self.shapes, shape))

    @property
    def triangles(self) -> str:
        """The numbers of triangles of its props, as text."""
        counts = sorted({len(shape.mesh.faces) for shape in self.shapes.values()})
        return f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"


def demo(rate_hz: float | None = None) -> Scenario:
    """The recording that `manipnet-serve --demo` plays, at its own rate or at another one."""
    return take(DEMO_FILE, {name: LIBRARY_FOLDER / f"{name}.ply" for name in DEMO_OBJECTS}, rate_hz)


def take(path: Path, meshes: Mapping[str, Path], rate_hz: float | None = None) -> Scenario:
    """A take with a mesh for each of its objects. Raises `TakeError` and `MeshError`."""
    recorded = read_take(path)
    if rate_hz is not None and rate_hz != recorded.rate_hz:
        recorded = resample(recorded, rate_hz)
    if missing := set(recorded.objects) - meshes.keys():
        raise TakeError(f"{path}: no mesh for {', '.join(sorted(missing))}; give --mesh NAME=FILE for each")
    shapes = {name: load_shape(meshes[name]) for name in recorded.objects}
    frames = list(take_frames(recorded))
    return Scenario(recorded.name, recorded.rate_hz, frames, {name: meshes[name] for name in shapes}, shapes)


def actor_names(actors: int) -> list[str]:
    """Names for a number of actors."""
    return [f"actor{i}" for i in range(actors)]


def actor_config(scenario: Scenario, name: str, actors: int) -> ActorConfig:
    """The configuration of one of several actors, for bodies with the names that `endless` gives them."""
    prefix = body_prefix(name, actors)
    return ActorConfig(
        name,
        {wrist: BodyConfig(prefix + wrist) for wrist in WRISTS},
        tuple(ObjectConfig(thing, BodyConfig(prefix + thing), path) for thing, path in scenario.meshes.items()),
    )


def endless(scenario: Scenario, actors: int = 1) -> Iterator[BodyFrame]:
    """Yield the frames forward and backward for ever, so that nothing jumps. Each has the bodies of all actors."""
    frames = scenario.frames
    names = actor_names(actors)
    ahead = [round(i * APART * len(frames)) for i in range(actors)]
    k = 0
    while True:
        bodies = tuple(
            body._replace(name=body_prefix(name, actors) + (body.name or ""))
            for name, shift in zip(names, ahead, strict=True)
            for body in frames[_bounced(k + shift, len(frames))].bodies
        )
        t_s = k / scenario.rate_hz
        yield BodyFrame(t_s, k, bodies, t_s, "bench:scenario")
        k += 1


def body_prefix(name: str, actors: int) -> str:
    """What the names of an actor's bodies start with, where there are several actors."""
    return f"{name}/" if actors > 1 else ""


def _bounced(k: int, count: int) -> int:
    k %= max(2 * (count - 1), 1)
    return k if k < count else 2 * (count - 1) - k
