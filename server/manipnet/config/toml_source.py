"""Parses a rig file to a tree of values, applies the settings of the command line, and finds the line of each key."""

import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from manipnet.common.options import ConfigError

Place = tuple[str | int, ...]
"""The path of a key from the top down, with an index for an entry of a list of tables."""

_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\[\]#]+?)\s*\]\]?\s*(#.*)?$")
_ASSIGNMENT = re.compile(r"^\s*([A-Za-z0-9_.\"'-]+)\s*=")


def read_tree(text: str, where: str, settings: Sequence[str] = ()) -> tuple[dict[str, Any], dict[Place, str]]:
    """The values of a TOML text, overridden by `settings` of the form `KEY=VALUE`, and how errors name each key.

    Raises `ConfigError`.
    """
    try:
        tree = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{where}: not TOML: {error}") from None
    places = {at: f"{where}:{line}" for at, line in key_lines(text).items()}
    for setting in settings:
        change = _parse_setting(setting)
        tree = _merged(tree, change)
        places |= dict.fromkeys(_paths(change), f"--set {setting}")
    return tree, places


def _parse_setting(setting: str) -> dict[str, Any]:
    """Parse `KEY=VALUE` as TOML. A value that is not TOML is taken as text, so names need no quotes."""
    key, equals, value = setting.partition("=")
    for line in (setting, f"{key} = {json.dumps(value.strip())}") if equals else ():
        try:
            return tomllib.loads(line)
        except (ValueError, RecursionError):
            continue
    raise ConfigError(f"--set {setting}: it is not KEY=VALUE with a key of a rig file, for example bodies.left_wrist=3")


def _merged(old: Any, new: Any) -> Any:
    if not (isinstance(old, dict) and isinstance(new, dict)):
        return new
    return {**old, **{key: _merged(old.get(key), value) for key, value in new.items()}}


def _paths(tree: Mapping[str, Any], at: Place = ()) -> list[Place]:
    """The paths of all leaves."""
    return [
        path
        for key, value in tree.items()
        for path in (_paths(value, (*at, key)) if isinstance(value, dict) and value else [(*at, key)])
    ]


def key_lines(text: str) -> dict[Place, int]:
    """The line of each table and key of a TOML text, by path. It need not be exact for odd texts."""
    lines: dict[Place, int] = {}
    counts: dict[Place, int] = {}
    table: Place = ()
    for number, line in enumerate(text.splitlines(), 1):
        if header := _HEADER.match(line):
            table = _resolve(_split(header[2]), counts)
            if header[1] == "[[":
                counts[table] = counts.get(table, -1) + 1
                table = (*table, counts[table])
            lines.setdefault(table, number)
        elif assignment := _ASSIGNMENT.match(line):
            lines.setdefault((*table, *_split(assignment[1])), number)
    return lines


def _split(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


def _resolve(path: Place, counts: dict[Place, int]) -> Place:
    """The path with the current index after each list of tables in it, except at its end."""
    resolved: Place = ()
    for i, key in enumerate(path):
        resolved = (*resolved, key)
        if i < len(path) - 1 and resolved in counts:
            resolved = (*resolved, counts[resolved])
    return resolved
