"""Writes rig files: a whole configuration, or the result of a calibration into an existing file."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import InlineTable

from manipnet.common.atomic_file import replacing
from manipnet.common.options import ConfigError, to_toml
from manipnet.config.rig_reader import parse_rig
from manipnet.config.settings import ActorConfig, BodyConfig, ObjectConfig, ServerConfig, protocol_options
from manipnet.synthesis.hand.shipped_files import hand_name
from manipnet.synthesis.objects.library import LIBRARY_FOLDER

if TYPE_CHECKING:
    from manipnet.geometry import Array

BACKUP_SUFFIX: Final = ".bak"
_METRE_DIGITS, _QUATERNION_DIGITS = 6, 8


def rig_text(config: ServerConfig) -> str:
    """A configuration as the text of a rig file, from which the same configuration is read. Paths become absolute."""
    document = tomlkit.document()
    if len(config.actors) == 1 and config.actors[0].name == "actor":
        for key, value in _actor(config.actors[0]).items():
            document[key] = value
    document["server"] = server_table(config)
    if "bodies" not in document:
        actors = tomlkit.aot()
        for actor in config.actors:
            actors.append(tomlkit.item({"name": actor.name} | _actor(actor)))
        document["actors"] = actors
    return tomlkit.dumps(document)


def server_table(config: ServerConfig) -> dict[str, Any]:
    """The table `[server]` of a configuration, with every option that has a value."""
    declared = (config, *(config.of(options) for options in protocol_options()))
    return {key: value for each in declared for key, value in to_toml(each).items()}


def store(path: Path, actor: ActorConfig, backup: bool = True) -> Path:
    """Write the placement of the actor's wrists and props, and the size of its hands, into a rig file.

    Everything else in the file stays as it is, comments too. Returns the path of the `backup`. Raises `ConfigError`,
    and then the file has not changed.
    """
    path = path.resolve()
    try:
        before = path.read_bytes()
        text = before.decode("utf-8-sig")
        after = with_placements(text, actor)
        _check(after, path, actor)
        return replace_file(path, after, backup)
    except (OSError, ValueError, TOMLKitError, KeyError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        text = f"{path}: could not be changed ({reason}); add these lines yourself:\n{_lines(actor)}"
        raise ConfigError(text) from None


def replace_file(path: Path, text: str, backup: bool = True) -> Path:
    """Replace a file as a whole, after copying it to its `backup`. Returns the path of the backup. Raises `OSError`."""
    kept = path.with_name(path.name + BACKUP_SUFFIX)
    with replacing(path) as file:
        file.write(text.encode("utf-8"))
        if backup and path.exists():
            shutil.copy2(path, kept)
    return kept


def with_placements(text: str, actor: ActorConfig) -> str:
    """The text of a rig file with the placements and the hand size of an actor. Raises `ConfigError`."""
    document: Any = tomlkit.parse(text)
    table = document
    if "actors" in document:
        table = next((entry for entry in document["actors"] if entry["name"] == actor.name), None)
        if table is None:
            raise ConfigError(f"it no longer has an actor {actor.name!r}")
    for wrist, body in actor.wrists.items():
        if body.offset is not None:
            _place(table["bodies"], wrist, body)
    for thing in actor.objects:
        if thing.body.offset is not None:
            entry = next((entry for entry in table["objects"] if is_entry_of(entry, thing)), None)
            if entry is None:
                raise ConfigError(f"it no longer has an object {thing.name!r}")
            entry.update(_offset(thing.body.offset))
    if actor.hand_scale != table.get("hand_scale", 1.0):
        table["hand_scale"] = round(actor.hand_scale, 4)
    return tomlkit.dumps(document)


def _place(bodies: Any, wrist: str, body: BodyConfig) -> None:
    if isinstance(bodies.get(wrist), dict):
        bodies[wrist].update(_offset(body.offset))
    else:
        bodies[wrist] = _body(body)


def is_entry_of(entry: Mapping[str, Any], thing: ObjectConfig) -> bool:
    """Whether an entry of a rig file describes this object."""
    return entry.get("name", str(entry["body"])) == thing.name


def _check(text: str, path: Path, actor: ActorConfig) -> None:
    """Raise `ConfigError` unless the actor that is read from `text` has the right placements."""
    read = next(other for other in parse_rig(text, path.parent, str(path)).actors if other.name == actor.name)
    wanted = [*actor.wrists.values(), *(thing.body for thing in actor.objects)]
    found = [*read.wrists.values(), *(thing.body for thing in read.objects)]
    for a, b in zip(wanted, found, strict=True):
        if a.offset is not None and (b.offset is None or not np.allclose(a.offset, b.offset, atol=1e-4)):
            raise ConfigError(f"the placement of body {a.key!r} cannot be found in it")


def _actor(actor: ActorConfig) -> dict[str, Any]:
    table: dict[str, Any] = {"hand_scale": actor.hand_scale} if actor.hand_scale != 1.0 else {}
    table["bodies"] = {wrist: _body(body) for wrist, body in actor.wrists.items()}
    if actor.hand is not None:
        table["hand"] = hand_name(actor.hand) or str(actor.hand.resolve())
    if actor.limits:
        ends = {name: [_degrees(low), _degrees(high)] for name, (low, high) in actor.limits.items()}
        table["limits_deg"] = ends
    if actor.objects:
        table["objects"] = [_object(thing) for thing in actor.objects]
    return table


def _object(thing: ObjectConfig) -> dict[str, Any]:
    mesh = thing.mesh.resolve()
    table = {"body": thing.body.key, "mesh": mesh.stem if mesh.parent == LIBRARY_FOLDER.resolve() else str(mesh)}
    defaults = {"name": str(thing.body.key), "unit": "m", "scale": 1.0}
    table |= {key: getattr(thing, key) for key, value in defaults.items() if getattr(thing, key) != value}
    return table | _offset(thing.body.offset)


def _body(body: BodyConfig) -> Any:
    if body.offset is None:
        return body.key
    table: InlineTable = tomlkit.inline_table()
    table.update({"body": body.key} | _offset(body.offset))
    return table


def _offset(offset: "Array | None") -> dict[str, Any]:
    if offset is None:
        return {}
    position = [round(float(x), _METRE_DIGITS) + 0.0 for x in offset[:3]]
    rotation = [round(float(x), _QUATERNION_DIGITS) + 0.0 for x in offset[3:]]
    return {"position": position, "rotation": rotation}


def _degrees(radians: float) -> float:
    return round(float(np.degrees(radians)), 6)


def _lines(actor: ActorConfig) -> str:
    """The lines of a rig file for an actor's placements."""
    bodies = {wrist: _body(body) for wrist, body in actor.wrists.items()}
    objects = [_object(thing) for thing in actor.objects if thing.body.offset is not None]
    table = {"hand_scale": round(actor.hand_scale, 4), "bodies": bodies} | ({"objects": objects} if objects else {})
    return tomlkit.dumps(table)
