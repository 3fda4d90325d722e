"""The OSC addresses that a rig file declares, as the value of an option."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from manipnet.common.options import ConfigError, Kind, shorten
from manipnet.inputs.osc.patterns import COMPONENTS, EULER, FRAME, KEYS, Pattern
from manipnet.inputs.osc.space import ROTATION_ORDERS, Space, read_axes
from manipnet.synthesis.objects.units import UNITS_M

MOST: Final = 64
ANGLES: Final = {"degrees": math.radians(1.0), "radians": 1.0}
_ALLOWED_KEYS: Final = ("address", "arguments", "body", "axes", "unit", "angles", "rotation_order")
_WORDS: Final = (*KEYS, *COMPONENTS, *FRAME[1:], "tracked", "-")
_NOT_IN_ADDRESSES: Final = frozenset(" #*,?[]{}")


class Addresses(Kind):
    """A list of declared addresses, each a table; on the command line, an inline table in TOML."""

    metavar = "TABLE"
    repeatable = True
    allowed = "tables, for example { address = '/tracker/<body>', arguments = 'x y z qx qy qz qw' }"

    def read(self, value: Any, folder: Path) -> tuple[Pattern, ...]:
        """The patterns of a list of tables. Raises `ValueError` and `ConfigError`."""
        if not isinstance(value, list) or not all(isinstance(each, dict) for each in value):
            raise ValueError
        if len(value) > MOST:
            raise ConfigError(f"has {len(value)} addresses; at most {MOST} are allowed")
        patterns = tuple(read_pattern(each) for each in value)
        seen: set[tuple[str, str]] = set()
        for each in patterns:
            if (each.address, each.arguments) in seen:
                raise ConfigError(f"declares {each.address} twice with the same arguments")
            seen.add((each.address, each.arguments))
        return patterns

    def parse(self, text: Any) -> tuple[Pattern, ...]:
        """The patterns of inline tables. Raises `ValueError` and `ConfigError`."""
        import tomllib

        return self.read([tomllib.loads(f"table = {each}")["table"] for each in text], Path())

    def write(self, value: tuple[Pattern, ...]) -> list[dict[str, str]]:
        """The tables that `read` turns into the patterns."""
        return [_table(each) for each in value]


def read_pattern(table: Mapping[str, Any]) -> Pattern:
    """One declared address. Raises `ConfigError`, whose text says which key is wrong and what is allowed."""
    for key, value in table.items():
        if key not in _ALLOWED_KEYS:
            raise ConfigError(f"has the key {key!r}; allowed are {', '.join(_ALLOWED_KEYS)}")
        if not isinstance(value, str):
            raise ConfigError(f"has {key} = {shorten(value)}; it must be text")
    address, arguments = table.get("address", ""), table.get("arguments", "")
    if not address.startswith("/") or not _NOT_IN_ADDRESSES.isdisjoint(address):
        raise ConfigError(
            f"has the address {address!r}; it must begin with '/' and have no spaces or * ? , # [ ] {{ }}"
        )
    words = arguments.split()
    _check_words(address, words)
    body = table.get("body", "")
    _check_keys(address, words, body)
    return Pattern(address, " ".join(words), _space(address, table, not {*EULER}.isdisjoint(words)), body=body)


def _check_keys(address: str, words: list[str], body: str) -> None:
    """Raise `ConfigError` unless address, arguments and `body` say once which body a message is about."""
    counts = {key: address.count(f"<{key}>") + (key in words) for key in KEYS}
    counts["body"] += bool(body)
    if twice := [key for key, count in counts.items() if count > 1]:
        raise ConfigError(f"says more than once which {twice[0]} {address} is about")
    if counts["body"] and (counts["skeleton"] or counts["bone"]):
        raise ConfigError(f"names both a body and a bone of a skeleton for {address}; name one of the two")
    if counts["bone"] and not counts["skeleton"]:
        raise ConfigError(f"names a bone for {address}, but no skeleton; put <skeleton> into the address too")
    if not any(counts.values()) and not any(word in FRAME for word in words):
        raise ConfigError(
            f"does not say which body {address} is about: put <body> into the address, body into the arguments, or "
            "give body = 'NAME'"
        )


def _check_words(address: str, words: list[str]) -> None:
    if not words:
        raise ConfigError(f"does not say which arguments {address} has; give arguments = 'x y z qx qy qz qw'")
    wrong = next((word for word in words if word not in _WORDS and not word.startswith("=")), None)
    if wrong is not None:
        raise ConfigError(f"has the argument {wrong!r} for {address}; allowed are {' '.join(_WORDS)} and =WORD")
    named = [word for word in words if word != "-" and not word.startswith("=")]
    twice = next((word for i, word in enumerate(named) if word in named[:i]), None)
    if twice is not None:
        raise ConfigError(f"has the argument {twice} twice for {address}")
    if not named or {*named} <= {*KEYS}:
        raise ConfigError(f"gives no position, rotation or time for {address}; name them among the arguments")


def _space(address: str, table: Mapping[str, Any], has_angles: bool) -> Space:
    axes, unit = table.get("axes", "y-up"), table.get("unit", "m")
    angles, order = table.get("angles", "degrees"), table.get("rotation_order", "")
    try:
        read_axes(axes)
    except ValueError as error:
        raise ConfigError(f"has wrong axes for {address}: {error}") from None
    if unit not in UNITS_M:
        raise ConfigError(f"has the unit {unit!r} for {address}; allowed are {', '.join(UNITS_M)}")
    if angles not in ANGLES:
        raise ConfigError(f"has angles = {angles!r} for {address}; allowed are {', '.join(ANGLES)}")
    if order and order not in ROTATION_ORDERS:
        raise ConfigError(f"has rotation_order = {order!r} for {address}; allowed are {', '.join(ROTATION_ORDERS)}")
    if has_angles and not order:
        raise ConfigError(
            f"needs rotation_order for the angles of {address}, the fixed axes about which they turn, the first turn "
            f"first: {', '.join(ROTATION_ORDERS)}; Unity and VRChat use zxy"
        )
    return Space(axes, UNITS_M[unit], order or "zxy", ANGLES[angles])


def _table(pattern: Pattern) -> dict[str, str]:
    space = pattern.space
    unit = next(name for name, size_m in UNITS_M.items() if size_m == space.unit_m)
    angles = next(name for name, size in ANGLES.items() if size == space.angle)
    table = {"address": pattern.address, "arguments": pattern.arguments, "axes": space.axes, "unit": unit}
    table |= {"angles": angles, "rotation_order": space.rotation_order}
    return table | ({"body": pattern.body} if pattern.body else {})
