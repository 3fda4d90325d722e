"""Damages inputs: cuts, splices and doubles good ones, puts in numbers that break readers, and replaces values of
well-formed documents. Every function takes the random generator as an argument."""

import copy
from collections.abc import Iterator, Sequence
from random import Random
from typing import Any

MAX_BYTES = 70_000
_NUMBERS = [
    b"\0",
    b"\xff",
    b"\x7f",
    b"\x80",
    b"\0\0\0\0",
    b"\xff\xff\xff\xff",
    b"\x7f\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\x80\0\0\0",
    b"\0\0\xc0\x7f",
    b"\x7f\xc0\0\0",
    b"NaN",
    b"1e999",
    b"[" * 200,
    b"\x91" * 200,
    b"#bundle\0\0\0\0\0\0\0\0\1",
    b'"',
    b"/*",
]

_ODD = [
    None,
    True,
    -1,
    0,
    2**31,
    2**63,
    2**64 - 1,
    0.0,
    -0.0,
    1e-320,
    1e308,
    float("inf"),
    float("nan"),
    "",
    "x",
    "x" * 5000,
    "\0",
    "\u202e",
    "..",
    "/",
    [],
    [[]],
    [0.0] * 300,
    {},
    {"": {}},
    {"x": [{"x": [{}]}]},
]


def damaged(rng: Random, good: Sequence[bytes]) -> bytes:
    """A good input after up to six kinds of damage, or random bytes."""
    if rng.random() < 0.05:
        return rng.randbytes(rng.randrange(600))
    data = rng.choice(good)
    for _ in range(rng.randint(1, 6)):
        data = _hurt(rng, data, good)
    return data


def _hurt(rng: Random, data: bytes, good: Sequence[bytes]) -> bytes:
    at = rng.randint(0, len(data))
    match rng.randrange(7):
        case 0:
            return data[:at]
        case 1:
            return data[at:]
        case 2:
            patch = rng.choice(_NUMBERS)
            return data[:at] + patch + data[at + len(patch) :]
        case 3:
            return data[:at] + rng.choice(_NUMBERS) + data[at:]
        case 4:
            return data[:at] + rng.randbytes(rng.randint(1, 4)) + data[at + 1 :]
        case 5:
            other = rng.choice(good)
            return data[:at] + other[rng.randint(0, len(other)) :]
    return (data * rng.randint(2, 50))[:MAX_BYTES]


def reshaped(rng: Random, document: Any) -> Any:
    """A copy of a good document in which up to three values were replaced, removed, doubled, renamed or inserted."""
    document = copy.deepcopy(document)
    for _ in range(rng.randint(1, 3)):
        if places := list(_places(document)):
            _misplace(rng, *rng.choice(places))
    return document


def _misplace(rng: Random, inside: Any, key: Any) -> None:
    odd = copy.deepcopy(rng.choice(_ODD))
    match rng.randrange(4):
        case 0:
            inside[key] = odd
        case 1:
            del inside[key]
        case 2:
            inside[key] = [inside[key], copy.deepcopy(inside[key])]
        case 3 if isinstance(inside, dict):
            inside[rng.choice(("", "x", "server", "body", "name", "é"))] = inside.pop(key)
        case 3:
            inside.insert(key, odd)


def _places(inside: Any) -> Iterator[tuple[Any, Any]]:
    """Every value of a document: its container and its key there."""
    for key in list(inside) if isinstance(inside, dict) else range(len(inside)):
        yield inside, key
        if isinstance(inside[key], dict | list):
            yield from _places(inside[key])
