"""What a request is, how its values are checked, and how it is refused."""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from manipnet.geometry import Array
from manipnet.wire.bodies import MessageError, check_name

MAX_ID: Final = 1 << 31
MAX_DIGITS: Final = 10**60
Request = Mapping[str, Any]
Handler = Callable[[Request], dict[str, Any]]


class RequestError(ValueError):
    """A request that is refused; the text says what was wrong and what is allowed."""


def number(request: Request, key: str, low: float, high: float, default: float | None = None) -> float:
    """A number within `low` … `high`. Raises `RequestError`."""
    value = request.get(key, default)
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or (isinstance(value, float) and not math.isfinite(value))
    ):
        raise RequestError(f"{key} is {quoted(value)}; it must be a number in {low} … {high}")
    if not low <= value <= high:
        raise RequestError(f"{key} is {quoted(value)}; allowed are {low} … {high}")
    return float(value)


def numbers(request: Request, key: str, default: Sequence[float]) -> Array:
    """As many numbers as in `default`, each within ±100. Raises `RequestError`."""
    values = request.get(key, default)
    if not isinstance(values, list | tuple) or len(values) != len(default):
        raise RequestError(f"{key} is {quoted(values)}; it must be {len(default)} numbers")
    return np.array([number({key: value}, key, -100.0, 100.0) for value in values])


def flag(request: Request, key: str, default: bool) -> bool:
    """A truth value. Raises `RequestError`."""
    value = request.get(key, default)
    if not isinstance(value, bool):
        raise RequestError(f"{key} is {quoted(value)}; allowed are true and false")
    return value


def choice(request: Request, key: str, allowed: tuple, default: Any = None) -> Any:
    """One of the `allowed` values. Raises `RequestError`, which lists them."""
    value = request.get(key, default)
    if isinstance(value, bool) or value not in allowed:
        raise RequestError(f"{key} is {quoted(value)}; allowed are {', '.join(map(str, allowed))}")
    return value


def body_key(request: Request) -> int | str:
    """The streaming id or name of a body, from the key `body`. Raises `RequestError`."""
    body = request.get("body")
    if isinstance(body, int) and not isinstance(body, bool):
        if not -MAX_ID <= body < MAX_ID:
            raise RequestError(f"body is {quoted(body)}; a streaming id is an integer of at most 31 bits")
        return body
    if not isinstance(body, str):
        raise RequestError(f"body is {quoted(body)}; give the streaming id or the name of a body")
    try:
        return check_name(body, "body")
    except MessageError as error:
        raise RequestError(str(error)) from None


def is_writable_name(path: Path) -> bool:
    """Whether the system can write the name of a file in its encoding, which under `LANG=C` may be ASCII."""
    try:
        os.fsencode(path)
    except UnicodeEncodeError:
        return False
    return True


def quoted(value: Any) -> str:
    """A value of a request for an error message, at most 60 characters."""
    if isinstance(value, int) and abs(value) >= MAX_DIGITS:
        return "a huge integer"  # Python refuses to write it down
    text = "missing" if value is None else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}…"
