"""Takes as a rig sees them: which body is which wrist or prop, where those sit on it, and how large the hands are.

What a tracker sent is bodies; what a server recorded, beside the hands it made, are wrists and props already.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from manipnet.config.rig_reader import load_rig, parse_rig
from manipnet.config.settings import ActorConfig, BodyConfig
from manipnet.geometry import compose
from manipnet.recording.mcap_file import HANDS, read_about, read_hands
from manipnet_tools.takes.meshes import MeshFile
from manipnet_tools.takes.take import BodyTrack, Take, TakeError, conventional, read_take


@dataclass(frozen=True)
class RigText:
    """A rig file's text, `where` it is from for errors, who of its actors is meant (the first by default), and the
    meshes of that one's props."""

    text: str
    where: str
    actor: str | None = None
    meshes: Mapping[str, MeshFile] = field(default_factory=dict)

    def config(self) -> ActorConfig:
        """The actor. Raises `ConfigError` and `TakeError`."""
        actors = {actor.name: actor for actor in parse_rig(self.text, Path(), self.where, find_mesh=Path).actors}
        if self.actor is not None and self.actor not in actors:
            raise TakeError(f"{self.where}: --actor {self.actor} is not one of {', '.join(actors)}")
        return actors[self.actor or next(iter(actors))]


@dataclass(frozen=True)
class Staged:
    """A take of wrists and props, and the size of its hands over the model's."""

    take: Take
    hand_scale: float = 1.0


def read_rig(file: Path | None, actor: str | None = None) -> RigText | None:
    """A rig file; None without one. Raises `ConfigError` and `TakeError`."""
    if file is None:
        return None
    actors = {one.name: one for one in load_rig(file).actors}
    rig = RigText(file.read_text(encoding="utf-8-sig"), str(file), actor)
    things = actors[rig.config().name].objects
    return replace(
        rig, meshes={thing.name: MeshFile(thing.mesh.absolute(), thing.unit, thing.scale) for thing in things}
    )


def read_staged(path: Path, rig: RigText | None = None) -> Staged:
    """A take as its rig sees it: `rig`, or else the one that a recording of bodies alone keeps.

    Raises `TakeError` and `ConfigError`.
    """
    take = read_take(path)
    about = read_about(path) if path.suffix.lower() == ".mcap" else None
    if about is not None and about.counts.get(HANDS):
        return Staged(take, _shown_scale(path) if rig is None else rig.config().hand_scale)
    if rig is None and about is not None and "rig" in about.metadata:
        rig = RigText(about.metadata["rig"], f"the rig in {path}")
    if rig is None:
        return Staged(take)
    config = rig.config()
    return Staged(cast(take, config, rig.where), config.hand_scale)


def cast(take: Take, config: ActorConfig, where: str) -> Take:
    """The take's bodies as the wrists and props of an actor, where those sit on them; bodies the rig does not know
    stay as they are. Raises `TakeError` for a wrist whose body is not there."""
    parts: Mapping[str, BodyConfig] = config.wrists | {thing.name: thing.body for thing in config.objects}
    names = {part: _name(take, body) for part, body in parts.items()}
    for wrist, body in config.wrists.items():
        if names[wrist] is None:
            raise TakeError(f"{where}: bodies.{wrist} is {body.key!r}; {take.name} has {', '.join(take.bodies)}")
    known = {part: _placed(take.bodies[name], parts[part]) for part, name in names.items() if name is not None}
    others = {name: track for name, track in take.bodies.items() if name not in names.values()}
    return replace(take, bodies=others | known)


def _name(take: Take, body: BodyConfig) -> str | None:
    """What the take calls a body of the rig."""
    return next((name for name in (str(body.key), conventional(str(body.key))) if name in take.bodies), None)


def _placed(track: BodyTrack, body: BodyConfig) -> BodyTrack:
    return track if body.offset is None else replace(track, poses=compose(track.poses, body.offset))


def _shown_scale(recording: Path) -> float:
    """The size of the hands that a recording shows."""
    hands = next(iter(read_hands(recording))).hands.values()
    return next((hand.scale for hand in hands), 1.0)
