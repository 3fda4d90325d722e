"""Reads plain values out of a pickle without running any of it.

NumPy stores a dictionary as a pickle, which may name code to run. Here only values are built: numbers, texts, lists,
tuples and dictionaries. Where the pickle names code, a `Named` stands in the result, and nothing is imported or called.
"""

import pickletools
import warnings
from dataclasses import dataclass
from typing import Any, Final

_CONSTANTS: Final = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False}
_NEW: Final = {"EMPTY_LIST": list, "EMPTY_DICT": dict, "EMPTY_SET": set, "EMPTY_TUPLE": tuple}
_IGNORED: Final = {"PROTO", "FRAME", "STOP"}
_VALUES: Final = (
    "BININT",
    "INT",
    "LONG",
    "BINFLOAT",
    "FLOAT",
    "BINUNICODE",
    "SHORT_BIN",
    "BINBYTES",
    "BINSTRING",
    "UNICODE",
    "STRING",
)
_MARK: Final = object()


@dataclass
class Named:
    """What the pickle would have made by running code; `state` holds the values that it gives to the result."""

    state: Any = None


def plain_values(data: bytes) -> Any:
    """The value in a pickle. Raises `ValueError` for anything but plain values."""
    stack: list[Any] = []
    memo: dict[int, Any] = {}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # odd escapes in the texts of a damaged file
            for opcode, argument, _ in pickletools.genops(data):
                _run(opcode.name, argument, stack, memo)
        return stack[-1]
    except (IndexError, KeyError, TypeError, AttributeError, StopIteration, RecursionError) as error:
        raise ValueError(f"is damaged ({type(error).__name__}: {error})") from None


def _run(name: str, argument: Any, stack: list[Any], memo: dict[int, Any]) -> None:
    if name in _IGNORED:
        return
    if name in _CONSTANTS:
        stack.append(_CONSTANTS[name])
    elif name in _NEW:
        stack.append(_NEW[name]())
    elif name == "MARK":
        stack.append(_MARK)
    elif name in ("TUPLE1", "TUPLE2", "TUPLE3"):
        count = int(name[-1])
        stack[-count:] = [tuple(stack[-count:])]
    elif name in ("TUPLE", "LIST"):
        stack.append((tuple if name == "TUPLE" else list)(_to_mark(stack)))
    elif name == "APPENDS":
        items = _to_mark(stack)
        stack[-1].extend(items)
    elif name == "APPEND":
        item = stack.pop()
        stack[-1].append(item)
    elif name in ("SETITEM", "SETITEMS", "DICT"):
        _set_items(name, stack)
    elif name == "MEMOIZE":
        memo[len(memo)] = stack[-1]
    elif name in ("BINPUT", "LONG_BINPUT", "PUT"):
        memo[int(argument)] = stack[-1]
    elif name in ("BINGET", "LONG_BINGET", "GET"):
        stack.append(memo[int(argument)])
    elif name == "GLOBAL":
        stack.append(Named())
    elif name in ("STACK_GLOBAL", "REDUCE", "NEWOBJ"):
        stack[-2:] = [Named()]
    elif name == "BUILD":
        state = stack.pop()
        stack[-1] = Named(state)
    elif name.startswith(_VALUES):
        stack.append(argument)
    else:
        raise ValueError(f"holds something other than plain values ({name})")


def _to_mark(stack: list[Any]) -> list[Any]:
    """Take everything above the last mark off the stack."""
    at = len(stack) - 1 - next(i for i, value in enumerate(reversed(stack)) if value is _MARK)
    items = stack[at + 1 :]
    del stack[at:]
    return items


def _set_items(name: str, stack: list[Any]) -> None:
    if name == "SETITEM":
        items = stack[-2:]
        del stack[-2:]
    else:
        items = _to_mark(stack)
    pairs = dict(zip(items[::2], items[1::2], strict=True))
    if name == "DICT":
        stack.append(pairs)
    else:
        stack[-1].update(pairs)
