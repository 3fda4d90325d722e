"""The flags of the command line, made from the declared options."""

import argparse
from collections.abc import Iterable
from typing import Any, Protocol

from manipnet.common.options import Option


class Flags(Protocol):
    """A parser or a group of a parser."""

    def add_argument(self, *names: str, **how: Any) -> Any: ...


def add_flags(flags: Flags, options: Iterable[Option]) -> None:
    """Add the flag of each option. `read_flags` finds the values in the parsed arguments."""
    for each in options:
        default = f" (default: {each.shown_default})" if each.shown_default else ""
        help = f"{each.help}{default}".replace("%", "%%")
        if not each.kind.metavar:
            flags.add_argument(each.flag, dest=each.key, action="store_const", const=True, help=help)
        else:
            action = "append" if each.kind.repeatable else "store"
            flags.add_argument(each.flag, dest=each.key, action=action, metavar=each.kind.metavar, help=help)


def read_flags(arguments: argparse.Namespace, options: Iterable[Option]) -> dict[str, Any]:
    """The values of the options that were given, by key. Raises `ConfigError`."""
    given = {each: getattr(arguments, each.key, None) for each in options}
    return {each.key: each.parse(text) for each, text in given.items() if text is not None}
