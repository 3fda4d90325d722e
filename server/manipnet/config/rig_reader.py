"""Rig files: which streamed body plays which part, in TOML. See `docs/rig.md`."""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from manipnet.config.settings import SCALE_RANGE, WRISTS, ActorConfig, BodyConfig, ConfigError, ObjectConfig
from manipnet.config.toml_source import read_tree
from manipnet.geometry import Array, quat_normalize
from manipnet.synthesis.model.layout import MAX_LOOK_AHEAD_S
from manipnet.synthesis.model.providers import PROVIDERS
from manipnet.synthesis.objects.library import library_file, library_names
from manipnet.synthesis.objects.mesh import UNITS_M
from manipnet.wire.hand_names import ANGLE_NAMES

MAX_FILE_BYTES = 1_000_000

SERVER_KEYS: Mapping[str, tuple[type, ...]] = {
    "host": (str,),
    "port": (int,),
    "input_port": (int,),
    "control_port": (int,),
    "osc_port": (int,),
    "page_port": (int,),
    "web_port": (int,),
    "metrics_port": (int,),
    "natnet": (str,),
    "multicast": (bool,),
    "interface": (str,),
    "up": (str,),
    "vmc": (str,),
    "livelink": (str,),
    "model": (str,),
    "provider": (str,),
    "look_ahead": (int, float),
    "objects": (str,),
    "objects_unit": (str,),
    "keys": (str,),
    "allow": (list,),
    "insecure": (bool,),
    "demo": (bool,),
    "takes": (str,),
    "dump_dir": (str,),
}
"""What the table `[server]` may hold: the command line's options of these names, which win over it."""

_KINDS = {str: "text", int: "an integer", float: "a number", bool: "true or false", list: "a list of text"}
_ACTOR_KEYS = ("bodies", "objects", "hand_scale", "limits_deg")
_FOLDERS = ("keys", "objects", "takes", "dump_dir")
"""Keys of `[server]` that name folders, as the rig file sees them."""
DEFAULT_ACTOR_TOML = "[bodies]\nleft_wrist = 'left_wrist'\nright_wrist = 'right_wrist'\n"
"""Who is expected when no file says otherwise."""
_OFFSET_KEYS = ("body", "position", "rotation")


@dataclass(frozen=True, slots=True)
class Rig:
    """A rig file's content."""

    actors: tuple[ActorConfig, ...]
    server: dict[str, Any] = field(default_factory=dict)


def load_rig(path: Path | None, settings: Sequence[str] = ()) -> Rig:
    """Read a rig file (None: bodies named like the wrists), with `settings` `KEY=VALUE` on top.

    Raises `ConfigError`, whose text starts with the file and, where it can, the line.
    """
    if path is None:
        return parse_rig(None, Path(), "--set", settings)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    if len(content) > MAX_FILE_BYTES:
        raise ConfigError(f"{path}: is {len(content)} bytes; a rig file has at most {MAX_FILE_BYTES}")
    try:
        text = content.decode("utf-8-sig")  # some editors begin a file with a byte order mark
    except ValueError as error:
        raise ConfigError(f"{path}: not TOML: {error}; save it as UTF-8") from None
    return parse_rig(text, path.parent, str(path), settings)


def parse_rig(
    text: str | None,
    folder: Path,
    where: str,
    settings: Sequence[str] = (),
    find_mesh: Callable[[str], Path | None] | None = None,
) -> Rig:
    """A rig from the text of its file, `where` names it in errors; relative paths start at `folder`. A mesh is found
    there or in the library, unless `find_mesh` says where it is."""
    tree, places = read_tree(DEFAULT_ACTOR_TOML if text is None else text, where, settings)
    return _Reader(folder, where, places, find_mesh).rig(tree)


class _Reader:
    """Walks the parsed file; knows in which `places` its keys stand, for the errors."""

    def __init__(
        self, folder: Path, where: str, places: Mapping[tuple, str], find_mesh: Callable[[str], Path | None] | None
    ) -> None:
        self._folder, self._where, self._places = folder, where, places
        self._find_mesh = find_mesh or self._mesh

    def rig(self, top: dict[str, Any]) -> Rig:
        several = "actors" in top
        self._known(top, (), ("server", "actors") if several else ("server", *_ACTOR_KEYS))
        if several:
            tables = self._list_of_tables(top["actors"], ("actors",))
            actors = tuple(self._actor(table, ("actors", i)) for i, table in enumerate(tables))
        else:
            actors = (self._actor({"name": "actor"} | top, ()),)
        server = self._table(top.get("server", {}), ("server",))
        self._known(server, ("server",), tuple(SERVER_KEYS))
        for key, value in server.items():
            at = ("server", key)
            self._typed(value, SERVER_KEYS[key], at)
            if allowed := _wrong(key, value):
                self._fail(at, f"is {value!r}; allowed are {allowed}")
        folders = {key: self._folder / server[key] for key in _FOLDERS if key in server}
        return Rig(actors, server | folders)

    def _actor(self, table: dict[str, Any], at: tuple) -> ActorConfig:
        if at:
            self._known(table, at, ("name", *_ACTOR_KEYS))
        name = self._typed(table.get("name"), (str,), (*at, "name"))
        bodies = self._table(table.get("bodies", {}), (*at, "bodies"))
        self._known(bodies, (*at, "bodies"), WRISTS)
        wrists = {wrist: self._body(value, (*at, "bodies", wrist)) for wrist, value in bodies.items()}
        if not wrists:
            self._fail((*at, "bodies"), f"is missing; it names the body of {' and of '.join(WRISTS)}")
        tables = self._list_of_tables(table.get("objects", []), (*at, "objects"))
        objects = tuple(self._object(entry, (*at, "objects", i)) for i, entry in enumerate(tables))
        hand_scale = self._number(table.get("hand_scale", 1.0), (*at, "hand_scale"))
        if not SCALE_RANGE[0] <= hand_scale <= SCALE_RANGE[1]:
            self._fail((*at, "hand_scale"), f"is {hand_scale}; allowed are {SCALE_RANGE[0]} … {SCALE_RANGE[1]}")
        return ActorConfig(name, wrists, objects, hand_scale, self._limits(table.get("limits_deg", {}), at))

    def _limits(self, value: Any, at: tuple) -> dict[str, tuple[float, float]]:
        at = (*at, "limits_deg")
        self._known(self._table(value, at), at, ANGLE_NAMES)
        limits: dict[str, tuple[float, float]] = {}
        for name, ends in value.items():
            low, high = self._numbers(ends, 2, (*at, name))
            if not -180.0 <= low < high <= 180.0:
                self._fail((*at, name), f"is {ends}; allowed are -180 <= lower < upper <= 180 degrees")
            limits[name] = (math.radians(low), math.radians(high))
        return limits

    def _object(self, table: dict[str, Any], at: tuple) -> ObjectConfig:
        self._known(table, at, ("body", "mesh", "unit", "scale", "name", "position", "rotation"))
        body = BodyConfig(self._key(table.get("body"), (*at, "body")), self._offset(table, at))
        text = self._typed(table.get("mesh"), (str,), (*at, "mesh"))
        mesh = self._find_mesh(text)
        if mesh is None:
            library = ", ".join(library_names())
            there = self._folder / text if len(text) <= 256 else "of so long a name"
            return self._fail(
                (*at, "mesh"), f"is {_show(text)}; there is no file {there}, and the library has {library}"
            )
        unit = self._typed(table.get("unit", "m"), (str,), (*at, "unit"))
        if unit not in UNITS_M:
            self._fail((*at, "unit"), f"is {unit!r}; allowed are {', '.join(UNITS_M)}")
        scale = self._number(table.get("scale", 1.0), (*at, "scale"))
        name = self._typed(table.get("name", str(body.key)), (str,), (*at, "name"))
        return ObjectConfig(name, body, mesh, unit, scale)

    def _mesh(self, text: str) -> Path | None:
        beside = self._folder / text
        return beside if os.path.isfile(beside) else library_file(text)  # Path.is_file raises for what is no path

    def _body(self, value: Any, at: tuple) -> BodyConfig:
        if not isinstance(value, dict):
            return BodyConfig(self._key(value, at))
        self._known(value, at, _OFFSET_KEYS)
        return BodyConfig(self._key(value.get("body"), (*at, "body")), self._offset(value, at))

    def _key(self, value: Any, at: tuple) -> int | str:
        key = self._typed(value, (int, str), at, "a streaming id (integer) or a name (text)")
        return key if key != "" else self._fail(at, "is empty; it must be a streaming id or a name")

    def _offset(self, table: dict[str, Any], at: tuple) -> Array | None:
        if "position" not in table and "rotation" not in table:
            return None
        p = self._numbers(table.get("position", [0, 0, 0]), 3, (*at, "position"))
        q = self._numbers(table.get("rotation", [0, 0, 0, 1]), 4, (*at, "rotation"))
        if not np.linalg.norm(q) > 1e-6:
            self._fail((*at, "rotation"), "is zero; it must be a quaternion x, y, z, w")
        return np.concatenate([p, quat_normalize(q)])

    def _numbers(self, value: Any, count: int, at: tuple) -> Array:
        if not isinstance(value, list) or len(value) != count:
            self._fail(at, f"is {_show(value)}; it must be {count} numbers")
        return np.array([self._number(x, at) for x in value])

    def _number(self, value: Any, at: tuple) -> float:
        number = float(self._typed(value, (int, float), at, "a number"))
        return number if abs(number) < 1e6 else self._fail(at, f"is {number}; it must be finite and below 1e6")

    def _table(self, value: Any, at: tuple) -> dict[str, Any]:
        return self._typed(value, (dict,), at, f"a table [{'.'.join(str(k) for k in at)}]")

    def _list_of_tables(self, value: Any, at: tuple) -> list[dict[str, Any]]:
        good = isinstance(value, list) and all(isinstance(entry, dict) for entry in value)
        return value if good else self._fail(at, f"must be tables [[{at[-1]}]], not {_show(value)}")

    def _typed(self, value: Any, kinds: tuple[type, ...], at: tuple, allowed: str = "") -> Any:
        allowed = allowed or " or ".join(_KINDS[kind] for kind in kinds)
        if value is None:
            self._fail(at, f"is missing; it must be {allowed}")
        if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
            self._fail(at, f"is {_show(value)}; it must be {allowed}")
        return value

    def _known(self, table: dict[str, Any], at: tuple, allowed: tuple[str, ...]) -> None:
        for key in table:
            if key not in allowed:
                self._fail((*at, key), f"is not known here; allowed are {', '.join(allowed)}")

    def _fail(self, at: tuple, text: str) -> Any:
        place = next((self._places[at[:n]] for n in range(len(at), 0, -1) if at[:n] in self._places), self._where)
        dotted = "".join(f"[{key + 1}]" if isinstance(key, int) else f".{key}" for key in at).lstrip(".")
        raise ConfigError(f"{place}: {dotted} {text}")


def _wrong(key: str, value: Any) -> str:
    """What is allowed for a key of `[server]`, if this value is not."""
    if key.endswith("port") and not 0 <= value < 65536:
        return "0 (any free one) … 65535"
    if key == "look_ahead" and not 0.0 <= value <= MAX_LOOK_AHEAD_S:
        return f"0 … {MAX_LOOK_AHEAD_S} s"
    if key == "allow" and not all(isinstance(network, str) for network in value):
        return "networks as text, for example 192.168.1.0/24"
    if key == "provider" and value not in PROVIDERS:
        return ", ".join(PROVIDERS)
    if key == "objects_unit" and value not in UNITS_M:
        return ", ".join(UNITS_M)
    return "y, z" if key == "up" and value not in ("y", "z") else ""


def _show(value: Any) -> str:
    return repr(value) if len(repr(value)) <= 60 else f"{type(value).__name__} of {len(repr(value))} characters"
