"""What a request is, how it is checked and refused."""

import math
from collections.abc import Callable, Mapping
from typing import Any

Request = Mapping[str, Any]


Handler = Callable[[Request], dict[str, Any]]


class RequestError(ValueError):
    """A request that cannot be met; the text says what was wrong and what is allowed."""


def number(request: Request, key: str, low: float, high: float, default: float | None = None) -> float:
    """A number of the request within `low` … `high`; raises `RequestError`."""
    value = request.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise RequestError(f"{key} is {_show(value)}; it must be a number in {low} … {high}")
    if not low <= value <= high:
        raise RequestError(f"{key} is {value}; allowed are {low} … {high}")
    return float(value)


def choice(request: Request, key: str, allowed: tuple, default: Any = None) -> Any:
    """One of the `allowed` values; raises `RequestError`, which lists them."""
    value = request.get(key, default)
    if isinstance(value, bool) or value not in allowed:
        raise RequestError(f"{key} is {_show(value)}; allowed are {', '.join(map(str, allowed))}")
    return value


def _show(value: Any) -> str:
    text = "missing" if value is None else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}…"
