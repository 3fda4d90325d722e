"""Reads rig files, TOML files that say which streamed body is which wrist or prop. See `docs/rig.md`."""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from manipnet.common.options import ConfigError, shorten
from manipnet.config.settings import SCALE_RANGE, WRISTS, ActorConfig, BodyConfig, ObjectConfig, all_options
from manipnet.config.toml_source import Place, read_tree
from manipnet.synthesis.hand.shipped_files import hand_file
from manipnet.synthesis.objects.library import library_file, library_names
from manipnet.synthesis.objects.units import UNITS_M
from manipnet.wire.hand_names import ANGLE_NAMES

if TYPE_CHECKING:
    from manipnet.geometry import Array

MAX_FILE_BYTES = 1_000_000

DEFAULT_ACTOR_TOML = "[bodies]\nleft_wrist = 'left_wrist'\nright_wrist = 'right_wrist'\n"
"""The rig of a server that is given none."""

_KINDS = {str: "text", int: "an integer", float: "a number", bool: "true or false"}
_ACTOR_KEYS = ("bodies", "objects", "hand_scale", "limits_deg", "hand")
_OFFSET_KEYS = ("body", "position", "rotation")


@dataclass(frozen=True, slots=True)
class Rig:
    """The content of a rig file."""

    actors: tuple[ActorConfig, ...]
    server: dict[str, Any] = field(default_factory=dict)
    """The values of the server's options by key, as far as the file gives them."""


def load_rig(path: Path | None, settings: Sequence[str] = ()) -> Rig:
    """Read a rig file, then apply `settings` of the form `KEY=VALUE`. None stands for the default rig.

    Raises `ConfigError`, whose text starts with the file and, where possible, the line.
    """
    if path is None:
        return parse_rig(None, Path(), "--set", settings)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    if len(content) > MAX_FILE_BYTES:
        raise ConfigError(f"{path}: has {len(content)} bytes; a rig file may have at most {MAX_FILE_BYTES}")
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
    """Read a rig from `text`, with None for the default rig; errors call it `where`. Raises `ConfigError`.

    Relative paths start at `folder`. A mesh is looked for there and in the library, or else by `find_mesh`.
    """
    tree, places = read_tree(DEFAULT_ACTOR_TOML if text is None else text, where, settings)
    return _Reader(folder, where, places, find_mesh).rig(tree)


class _Reader:
    """Walks through a parsed file; `places` says where each key is, so that errors can name its line."""

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
        return Rig(actors, self._server(self._table(top.get("server", {}), ("server",))))

    def _server(self, table: dict[str, Any]) -> dict[str, Any]:
        options = all_options()
        self._known(table, ("server",), tuple(options))
        return {
            key: options[key].read(value, self._folder, self._place(("server", key))) for key, value in table.items()
        }

    def _actor(self, table: dict[str, Any], at: Place) -> ActorConfig:
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
        limits = self._limits(table.get("limits_deg", {}), at)
        return ActorConfig(name, wrists, objects, hand_scale, limits, self._hand(table.get("hand"), (*at, "hand")))

    def _hand(self, value: Any, at: Place) -> Path | None:
        if value is None:
            return None
        text = self._typed(value, (str,), at, "the file of a hand profile")
        if not text or len(text) > 4096:
            return self._fail(at, "is empty or too long for a file")
        return hand_file(text, self._folder)

    def _limits(self, value: Any, at: Place) -> dict[str, tuple[float, float]]:
        at = (*at, "limits_deg")
        self._known(self._table(value, at), at, ANGLE_NAMES)
        limits: dict[str, tuple[float, float]] = {}
        for name, ends in value.items():
            low, high = self._numbers(ends, 2, (*at, name))
            if not -180.0 <= low < high <= 180.0:
                self._fail((*at, name), f"is {ends}; allowed are -180 <= lower < upper <= 180 degrees")
            limits[name] = (math.radians(low), math.radians(high))
        return limits

    def _object(self, table: dict[str, Any], at: Place) -> ObjectConfig:
        self._known(table, at, ("body", "mesh", "unit", "scale", "name", "position", "rotation"))
        body = BodyConfig(self._key(table.get("body"), (*at, "body")), self._offset(table, at))
        text = self._typed(table.get("mesh"), (str,), (*at, "mesh"))
        mesh = self._find_mesh(text)
        if mesh is None:
            library = ", ".join(library_names())
            there = self._folder / text if len(text) <= 256 else "with so long a name"
            return self._fail(
                (*at, "mesh"), f"is {shorten(text)}; there is no file {there}, and the library has {library}"
            )
        unit = self._typed(table.get("unit", "m"), (str,), (*at, "unit"))
        if unit not in UNITS_M:
            self._fail((*at, "unit"), f"is {unit!r}; allowed are {', '.join(UNITS_M)}")
        scale = self._number(table.get("scale", 1.0), (*at, "scale"))
        name = self._typed(table.get("name", str(body.key)), (str,), (*at, "name"))
        return ObjectConfig(name, body, mesh, unit, scale)

    def _mesh(self, text: str) -> Path | None:
        beside = self._folder / text
        return beside if os.path.isfile(beside) else library_file(text)  # Path.is_file raises ValueError for some texts

    def _body(self, value: Any, at: Place) -> BodyConfig:
        if not isinstance(value, dict):
            return BodyConfig(self._key(value, at))
        self._known(value, at, _OFFSET_KEYS)
        return BodyConfig(self._key(value.get("body"), (*at, "body")), self._offset(value, at))

    def _key(self, value: Any, at: Place) -> int | str:
        key = self._typed(value, (int, str), at, "a streaming id (integer) or a name (text)")
        return key if key != "" else self._fail(at, "is empty; it must be a streaming id or a name")

    def _offset(self, table: dict[str, Any], at: Place) -> "Array | None":
        if "position" not in table and "rotation" not in table:
            return None
        p = self._numbers(table.get("position", [0, 0, 0]), 3, (*at, "position"))
        q = self._numbers(table.get("rotation", [0, 0, 0, 1]), 4, (*at, "rotation"))
        length = float(np.linalg.norm(q))
        if not length > 1e-6:
            self._fail((*at, "rotation"), "is zero; it must be a quaternion x, y, z, w")
        return np.concatenate([p, q / length])

    def _numbers(self, value: Any, count: int, at: Place) -> "Array":
        if not isinstance(value, list) or len(value) != count:
            self._fail(at, f"is {shorten(value)}; it must be {count} numbers")
        return np.array([self._number(x, at) for x in value])

    def _number(self, value: Any, at: Place) -> float:
        number = float(self._typed(value, (int, float), at, "a number"))
        return number if abs(number) < 1e6 else self._fail(at, f"is {number}; it must be finite and below 1e6")

    def _table(self, value: Any, at: Place) -> dict[str, Any]:
        return self._typed(value, (dict,), at, f"a table [{'.'.join(str(k) for k in at)}]")

    def _list_of_tables(self, value: Any, at: Place) -> list[dict[str, Any]]:
        good = isinstance(value, list) and all(isinstance(entry, dict) for entry in value)
        return value if good else self._fail(at, f"must be tables [[{at[-1]}]], not {shorten(value)}")

    def _typed(self, value: Any, kinds: tuple[type, ...], at: Place, allowed: str = "") -> Any:
        allowed = allowed or " or ".join(_KINDS[kind] for kind in kinds)
        if value is None:
            self._fail(at, f"is missing; it must be {allowed}")
        if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
            self._fail(at, f"is {shorten(value)}; it must be {allowed}")
        return value

    def _known(self, table: dict[str, Any], at: Place, allowed: tuple[str, ...]) -> None:
        for key in table:
            if key not in allowed:
                self._fail((*at, key), f"is not known here; allowed are {', '.join(allowed)}")

    def _fail(self, at: Place, text: str) -> Any:
        raise ConfigError(f"{self._place(at)} {text}")

    def _place(self, at: Place) -> str:
        """How an error names the key `at`: the file, the line of the key or of the nearest table, and the key."""
        place = next((self._places[at[:n]] for n in range(len(at), 0, -1) if at[:n] in self._places), self._where)
        dotted = "".join(f"[{key + 1}]" if isinstance(key, int) else f".{key}" for key in at).lstrip(".")
        return f"{place}: {dotted}"
