"""Writes into a rig file what was changed while the server ran: meshes, sizes, places and the look-ahead."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Array

from manipnet.common.options import ConfigError
from manipnet.config.rig_reader import parse_rig
from manipnet.config.rig_writer import BACKUP_SUFFIX, is_entry_of, replace_file, with_placements
from manipnet.config.settings import ActorConfig, BodyConfig, ObjectConfig
from manipnet.synthesis.model.providers import MAX_LOOK_AHEAD_S
from manipnet.synthesis.objects.library import LIBRARY_FOLDER

_SAME = 1e-6


def save_changes(path: Path, actors: Sequence[ActorConfig], look_ahead_s: float, backup: bool = True) -> Path:
    """Write the props, the places and the hand sizes of `actors`, and the look-ahead, into a rig file.

    Everything else stays as it is, comments too; a value that is the same is not touched. Returns the path of the
    backup. Raises `ConfigError`, and then the file has not changed.
    """
    path = path.resolve()
    try:
        before = path.read_bytes().decode("utf-8-sig")
        after = _with_look_ahead(before, path, look_ahead_s)
        for actor in actors:
            after = with_placements(
                _with_objects(after, path, actor), _moved(actor, _actor_in(before, path, actor.name))
            )
        _check(after, path, actors, look_ahead_s)
        return replace_file(path, after, backup) if after != before else path.with_name(path.name + BACKUP_SUFFIX)
    except (OSError, ValueError, TOMLKitError, KeyError, TypeError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ConfigError(f"{path}: could not be changed ({reason}); nothing was saved") from None


def _with_look_ahead(text: str, path: Path, look_ahead_s: float) -> str:
    if abs(_look_ahead_in(text, path) - look_ahead_s) < _SAME:
        return text
    document: Any = tomlkit.parse(text)
    document.setdefault("server", tomlkit.table())["look_ahead"] = round(look_ahead_s, 4)
    return tomlkit.dumps(document)


def _look_ahead_in(text: str, path: Path) -> float:
    return parse_rig(text, path.parent, str(path)).server.get("look_ahead", MAX_LOOK_AHEAD_S)


def _with_objects(text: str, path: Path, actor: ActorConfig) -> str:
    known = {thing.name: thing for thing in _actor_in(text, path, actor.name).objects}
    document: Any = tomlkit.parse(text)
    table = document
    if "actors" in document:
        table = next(entry for entry in document["actors"] if entry["name"] == actor.name)
    for thing in actor.objects:
        if thing.name not in known:
            entry = _appended(table)
            entry["body"] = thing.body.key
            entry["mesh"] = _mesh(thing, path)
        else:
            entry = next(entry for entry in table["objects"] if is_entry_of(entry, thing))
            if thing.mesh.resolve() != known[thing.name].mesh.resolve():
                entry["mesh"] = _mesh(thing, path)
        before = known.get(thing.name, ObjectConfig(thing.name, thing.body, thing.mesh))
        if thing.unit != before.unit:
            entry["unit"] = thing.unit
        if abs(thing.scale - before.scale) > _SAME:
            entry["scale"] = round(thing.scale, 6)
    return tomlkit.dumps(document)


def _appended(table: Any) -> Any:
    """A new entry at the end of the objects, which may be written as tables or as an array."""
    if "objects" not in table:
        table["objects"] = tomlkit.aot()
    is_array = isinstance(table["objects"], Array)
    table["objects"].append(tomlkit.inline_table() if is_array else tomlkit.table())
    return table["objects"][-1]


def _moved(actor: ActorConfig, before: ActorConfig) -> ActorConfig:
    """The actor with the placements that differ from those of before, and no others."""
    known = before.bodies()

    def only_new(role: str, body: BodyConfig) -> BodyConfig:
        old = known[role].offset if role in known else None
        same = old is not None and body.offset is not None and np.allclose(old, body.offset, atol=_SAME)
        return replace(body, offset=None) if same else body

    return replace(
        actor,
        wrists={role: only_new(role, body) for role, body in actor.wrists.items()},
        objects=tuple(replace(thing, body=only_new(thing.name, thing.body)) for thing in actor.objects),
    )


def _mesh(thing: ObjectConfig, path: Path) -> str:
    """A mesh as a rig file names it: by its name in the library, or by its path, relative to the rig if possible."""
    mesh = thing.mesh.resolve()
    if mesh.parent == LIBRARY_FOLDER.resolve():
        return mesh.stem
    return mesh.relative_to(path.parent).as_posix() if mesh.is_relative_to(path.parent) else os.fspath(mesh)


def _actor_in(text: str, path: Path, name: str) -> ActorConfig:
    actors = parse_rig(text, path.parent, str(path)).actors
    actor = next((actor for actor in actors if actor.name == name), None)
    if actor is None:
        raise ConfigError(f"it no longer has an actor {name!r}")
    return actor


def _check(text: str, path: Path, actors: Sequence[ActorConfig], look_ahead_s: float) -> None:
    """Raise `ConfigError` unless what is read from `text` is what was to be saved."""
    if abs(_look_ahead_in(text, path) - look_ahead_s) > 1e-3:
        raise ConfigError("the look-ahead cannot be found in it")
    for actor in actors:
        read = {thing.name: thing for thing in _actor_in(text, path, actor.name).objects}
        for thing in actor.objects:
            found = read.get(thing.name)
            same = found is not None and found.mesh.resolve() == thing.mesh.resolve() and found.unit == thing.unit
            if found is None or not same or abs(found.scale - thing.scale) > 1e-3:
                raise ConfigError(f"the object of {thing.name!r} cannot be found in it")
