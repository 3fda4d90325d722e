"""Applies a rig to a take: which body is which wrist or prop, where those sit on it, and the size of the hands.

A tracker sends bodies, to which a rig must be applied. A recording made beside a server has wrists and props already.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from manipnet.config.rig_reader import load_rig, parse_rig
from manipnet.config.settings import ActorConfig, BodyConfig
from manipnet.geometry import compose
from manipnet.recording.mcap_file import HANDS, read_about, read_hands
from manipnet_tools.takes.body_names import conventional
from manipnet_tools.takes.meshes import MeshFile
from manipnet_tools.takes.take import BodyTrack, Take, TakeError, read_take


@dataclass(frozen=True)
class RigText:
    """The text of a rig file, its origin `where` for error messages, the name of one of its actors (by default the
    first), the meshes of that actor's props, and the profile of its avatar's hand."""

    text: str
    where: str
    actor: str | None = None
    meshes: Mapping[str, MeshFile] = field(default_factory=dict)
    hand: Path | None = None

    def config(self) -> ActorConfig:
        """The actor's configuration. Raises `ConfigError` and `TakeError`."""
        actors = {actor.name: actor for actor in parse_rig(self.text, Path(), self.where, find_mesh=Path).actors}
        if self.actor is not None and self.actor not in actors:
            raise TakeError(f"{self.where}: there is no actor {self.actor!r}; the actors are {', '.join(actors)}")
        return actors[self.actor or next(iter(actors))]


@dataclass(frozen=True)
class RiggedTake:
    """A take of wrists and props, and the size of its hands relative to the model's."""

    take: Take
    hand_scale: float = 1.0


def read_rig(file: Path | None, actor: str | None = None) -> RigText | None:
    """Read a rig file, if there is one. Raises `ConfigError` and `TakeError`."""
    if file is None:
        return None
    actors = {one.name: one for one in load_rig(file).actors}
    rig = RigText(file.read_text(encoding="utf-8-sig"), str(file), actor)
    own = actors[rig.config().name]
    meshes = {prop.name: MeshFile(prop.mesh.absolute(), prop.unit, prop.scale) for prop in own.objects}
    return replace(rig, meshes=meshes, hand=None if own.hand is None else own.hand.absolute())


def read_rigged(path: Path, rig: RigText | None = None, up: Literal["y", "z"] = "y") -> RiggedTake:
    """Read a take and apply `rig`, or else the rig that is kept in a recording of bodies alone.

    `up` is the axis of the take that points up. Raises `TakeError` and `ConfigError`.
    """
    take = read_take(path, _keys(rig), up)
    about = read_about(path) if path.suffix.lower() == ".mcap" else None
    if about is not None and about.counts.get(HANDS):
        return RiggedTake(take, _recorded_scale(path) if rig is None else rig.config().hand_scale)
    if rig is None and about is not None and "rig" in about.metadata:
        rig = RigText(about.metadata["rig"], f"the rig in {path}")
    if rig is None:
        return RiggedTake(take)
    config = rig.config()
    return RiggedTake(apply_rig(take, config, rig.where), config.hand_scale)


def _keys(rig: RigText | None) -> frozenset[str]:
    """The names that a rig gives its bodies, which a take must not change."""
    if rig is None:
        return frozenset()
    config = rig.config()
    bodies = [*config.wrists.values(), *(prop.body for prop in config.objects)]
    return frozenset(str(body.key) for body in bodies)


def apply_rig(take: Take, config: ActorConfig, where: str) -> Take:
    """Turn the take's bodies into the wrists and props of an actor.

    Bodies that are not in the rig stay as they are. Raises `TakeError` if the body of a wrist is missing, and if a body
    that is not in the rig has the name of one of its props.
    """
    parts: Mapping[str, BodyConfig] = config.wrists | {prop.name: prop.body for prop in config.objects}
    names = {part: _name(take, body) for part, body in parts.items()}
    for wrist, body in config.wrists.items():
        if names[wrist] is None:
            raise TakeError(
                f"{where}: bodies.{wrist} is {body.key!r}, but the bodies of {take.name} are {', '.join(take.bodies)}"
            )
    known = {part: _placed(take.bodies[name], parts[part]) for part, name in names.items() if name is not None}
    others = {name: track for name, track in take.bodies.items() if name not in names.values()}
    if twice := others.keys() & known.keys():
        name = min(twice)
        raise TakeError(
            f"{where}: calls the body {names[name]!r} {name!r}, but another body of {take.name} has that name; "
            "rename the prop in the rig"
        )
    return replace(take, bodies=others | known)


def _name(take: Take, body: BodyConfig) -> str | None:
    """The take's name of a body in the rig, or None."""
    return next((name for name in (str(body.key), conventional(str(body.key))) if name in take.bodies), None)


def _placed(track: BodyTrack, body: BodyConfig) -> BodyTrack:
    return track if body.offset is None else replace(track, poses=compose(track.poses, body.offset))


def _recorded_scale(recording: Path) -> float:
    """The size of the hands in a recording, relative to the model's."""
    hands = next(iter(read_hands(recording))).hands.values()
    return next((hand.scale for hand in hands), 1.0)
