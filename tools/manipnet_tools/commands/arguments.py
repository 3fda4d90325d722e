"""Makes the command line of a verb from the dataclass of its options.

A field is an option, whose help is the text below it. The annotations say the rest:

    out: Annotated[Path, arg(metavar="FILE")]                  # required, --out FILE
    take: Annotated[Positional[Path], arg(metavar="TAKE")]     # an argument without a flag
    mesh: UseAppendAction[tuple[str, ...]] = ()                # --mesh may be repeated; without it, --mesh A B C
    training: TrainConfig = TrainConfig()                      # its fields become --training.NAME
"""

import argparse
import ast
import inspect
import textwrap
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from manipnet.common.command_line import Parser

T = TypeVar("T")
_POSITIONAL: Final = "positional"
_REPEATABLE: Final = "repeatable"
Positional = Annotated[T, _POSITIONAL]
"""An argument without a flag."""
UseAppendAction = Annotated[T, _REPEATABLE]
"""A tuple of which each use of the flag gives one value."""


@dataclass(frozen=True)
class arg:  # noqa: N801 - reads as an annotation
    """How an option is shown, and what to say about values that others might expect."""

    metavar: str = ""
    help_behavior_hint: str | None = None
    """Shown in place of the default value."""
    instead: Mapping[str, str] = field(default_factory=dict)
    """What to do instead, by a value that is not allowed."""


def parser_for(kind: type, prog: str, examples: Sequence[str] = ()) -> Parser:
    """The parser of the options `kind`, a dataclass."""
    parser = Parser(prog, inspect.cleandoc(kind.__doc__ or ""), examples)
    _add(parser, kind, "")
    return parser


def parsed(kind: type[T], parser: Parser, words: Sequence[str]) -> T:
    """The options that the `words` of a command line give. Ends the program for a mistyped one."""
    return _instance(kind, vars(parser.parse_args(list(words))), "")


def _add(parser: Parser, kind: type, prefix: str, defaults: Any = None) -> None:
    hints, helps = get_type_hints(kind, include_extras=True), _help_texts(kind)
    for each in fields(kind):
        default = _default(each) if defaults is None else getattr(defaults, each.name)
        if is_dataclass(hints[each.name]):
            _add(parser, hints[each.name], f"{prefix}{each.name}.", default)
        else:
            _add_option(parser, prefix + each.name, hints[each.name], helps.get(each.name, ""), default)


def _add_option(parser: Parser, name: str, hint: Any, help: str, default: Any) -> None:
    hint, marks = _unwrapped(hint)
    shown = next((mark for mark in marks if isinstance(mark, arg)), arg())
    base, nargs = _base(hint)
    hinted = shown.help_behavior_hint is not None or default in (MISSING, None, (), False)
    help = help if hinted else f"{help} (default: {_shown(default)})"
    how: dict[str, Any] = {"help": help.replace("%", "%%")}
    if base is bool:
        parser.add_argument(_flag(name), dest=name, action="store_true", default=argparse.SUPPRESS, **how)
        return
    how |= {"type": _reader(base, shown.instead), "metavar": shown.metavar or _metavar(base)}
    if nargs is not None and _REPEATABLE in marks:
        how["action"] = "append"
    elif nargs is not None:
        how["nargs"] = nargs
        if isinstance(nargs, int):
            how["metavar"] = tuple(how["metavar"].split()) if " " in how["metavar"] else how["metavar"]
    if _POSITIONAL in marks:
        parser.add_argument(name, **how)
    else:
        required = default is MISSING
        parser.add_argument(_flag(name), dest=name, default=argparse.SUPPRESS, required=required, **how)


def _instance(kind: type[T], given: Mapping[str, Any], prefix: str, defaults: Any = None) -> T:
    hints = get_type_hints(kind, include_extras=True)
    values: dict[str, Any] = {}
    for each in fields(kind):  # type: ignore[arg-type]
        name = prefix + each.name
        if is_dataclass(hints[each.name]):
            default = _default(each) if defaults is None else getattr(defaults, each.name)
            values[each.name] = _instance(hints[each.name], given, f"{name}.", default)  # type: ignore[arg-type]
        elif name in given:
            values[each.name] = tuple(given[name]) if isinstance(given[name], list) else given[name]
        elif defaults is not None:
            values[each.name] = getattr(defaults, each.name)
    return kind(**values)


def _default(each: Field) -> Any:
    return each.default_factory() if each.default_factory is not MISSING else each.default


def _unwrapped(hint: Any) -> tuple[Any, tuple[Any, ...]]:
    """A type without its annotations and without None, and the annotations."""
    marks: tuple[Any, ...] = ()
    while get_origin(hint) is Annotated:
        hint, marks = get_args(hint)[0], (*marks, *hint.__metadata__)
    if get_origin(hint) in (Union, types.UnionType):
        inner, more = _unwrapped(next(each for each in get_args(hint) if each is not type(None)))
        return inner, marks + more
    return hint, marks


def _base(hint: Any) -> tuple[Any, int | str | None]:
    """The type of one value, and for a tuple how many there are."""
    if get_origin(hint) is not tuple:
        return hint, None
    inner = get_args(hint)
    return (inner[0], "*") if inner[-1] is Ellipsis else (inner[0], len(inner))


def _reader(base: Any, instead: Mapping[str, str]) -> Callable[[str], Any]:
    """The function that makes a value of a word. It raises `argparse.ArgumentTypeError`."""
    allowed = get_args(base) if get_origin(base) is Literal else None
    what = {int: "a whole number", float: "a number"}.get(base, "")

    def read(word: str) -> Any:
        if allowed is not None and word not in allowed:
            more = f"; {instead[word]}" if word in instead else ""
            raise argparse.ArgumentTypeError(f"is {word!r}; allowed are {', '.join(allowed)}{more}")
        try:
            return word if allowed is not None else base(word)
        except ValueError:
            raise argparse.ArgumentTypeError(f"is {word!r}; it must be {what}") from None

    return read


def _metavar(base: Any) -> str:
    if get_origin(base) is Literal:
        return f"{{{','.join(get_args(base))}}}"
    return {int: "N", float: "NUMBER", Path: "PATH"}.get(base, "TEXT")


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _shown(default: Any) -> str:
    return " ".join(map(str, default)) if isinstance(default, tuple) else f"{default}"


def _help_texts(kind: type) -> dict[str, str]:
    """The texts below the fields of a class and of those from which it is derived."""
    texts: dict[str, str] = {}
    for each in reversed(kind.__mro__[:-1]):
        (found,) = ast.parse(textwrap.dedent(inspect.getsource(each))).body
        body = found.body if isinstance(found, ast.ClassDef) else []
        for before, after in pairwise(body):
            if isinstance(before, ast.AnnAssign) and isinstance(before.target, ast.Name) and _is_text(after):
                texts[before.target.id] = " ".join(ast.literal_eval(after.value).split())  # type: ignore[attr-defined]
    return texts


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
