"""Guesses which streamed bodies are wrists, from their names or else from how far they move, and writes a rig file."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from manipnet.common.options import ConfigError
from manipnet.config.settings import WRISTS, BodyKey
from manipnet.synthesis.objects.library import library_names
from manipnet.wire.bodies import BodyFrame, BodySample

STEP_M: Final = 0.005
"""Motion is measured in steps of this length, so that the noise of a tracker does not count."""
MOVED_M: Final = 0.3
"""A wrist that was waved has moved at least this far."""
_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_SIDES = {"left_wrist": {"left", "l", "lft"}, "right_wrist": {"right", "r", "rgt"}}
_HANDS = {"wrist", "hand", "glove", "palm"}
_SYNONYMS = {
    "box": "cube",
    "crate": "cube",
    "ball": "sphere",
    "cup": "mug",
    "can": "cylinder",
    "glass": "wine_glass",
}


@dataclass(slots=True)
class StreamedBody:
    """One body of the stream, and how far it has moved."""

    id: int | None
    name: str | None
    moved_m: float = 0.0
    _anchor: np.ndarray | None = field(default=None, repr=False)

    @property
    def key(self) -> BodyKey:
        """Its key in a rig: its name, which people can read, or else its streaming id."""
        return self.name if self.name else self.id if self.id is not None else ""

    def add(self, sample: BodySample) -> None:
        """Take one sample."""
        if not sample.tracked:
            return
        here = np.array(sample.p)
        step_m = 0.0 if self._anchor is None else float(np.linalg.norm(here - self._anchor))
        if self._anchor is None or step_m >= STEP_M:
            self._anchor, self.moved_m = here, self.moved_m + step_m


class BodyCollector:
    """Collects the bodies of all frames; a sink for receivers."""

    def __init__(self) -> None:
        self.bodies: dict[tuple[int | None, str | None], StreamedBody] = {}

    def __call__(self, frame: BodyFrame) -> None:
        """Take one frame."""
        for sample in frame.bodies:
            self.bodies.setdefault((sample.id, sample.name), StreamedBody(sample.id, sample.name)).add(sample)


@dataclass(frozen=True)
class Guess:
    """The body of each wrist with the reason for it, and the bodies that are left."""

    wrists: dict[str, tuple[BodyKey, str]]
    others: tuple[StreamedBody, ...]


def guess(bodies: Sequence[StreamedBody], given: Mapping[str, BodyKey]) -> Guess:
    """Find the wrists: those `given`, then those with a wrist's name, then the two bodies that moved most.

    Of the latter, the one that moved more is the right wrist. Raises `ConfigError` if no wrist can be found.
    """
    wrists: dict[str, tuple[BodyKey, str]] = {part: (key, "as given") for part, key in given.items()}
    left = {body.key: body for body in bodies if body.key not in given.values()}
    for part in WRISTS:
        named = [key for key, body in left.items() if _is_named(body.name, part)]
        if part not in wrists and named:
            wrists[part] = named[0], "by its name"
            del left[named[0]]
    missing = [part for part in reversed(WRISTS) if part not in wrists]
    waved = sorted((body for body in left.values() if body.moved_m >= MOVED_M), key=lambda body: -body.moved_m)
    for part, body in zip(missing, waved, strict=False):
        wrists[part] = body.key, f"it moved {body.moved_m:.1f} m; check that left and right are not swapped"
        del left[body.key]
    if not wrists:
        arrived = ", ".join(str(body.key) for body in bodies) or "none"
        raise ConfigError(
            f"no body has the name of a wrist, and none was waved (bodies that arrived: {arrived}); wave both hands "
            "while this command listens, the right hand more, or give --left-wrist BODY and --right-wrist BODY"
        )
    return Guess({part: wrists[part] for part in WRISTS if part in wrists}, tuple(left.values()))


def rig_of(found: Guess, server: Mapping[str, object]) -> str:
    """The text of a rig file. Bodies for which no mesh is known are written as comments."""
    lines = ["# Written by `manipnet rig init`; see docs/rig.md.", "[bodies]"]
    lines += [f"{part} = {_toml(key)}   # {reason}" for part, (key, reason) in found.wrists.items()]
    for body in found.others:
        mesh = likely_mesh(body.name)
        lines += [
            "",
            *(_object(body, mesh) if mesh else [f"# {line}" for line in _object(body, "your own mesh.obj")]),
        ]
    if server:
        lines += ["", "[server]", *(f"{key} = {_toml(value)}" for key, value in server.items())]
    return "\n".join(lines) + "\n"


def _object(body: StreamedBody, mesh: str) -> list[str]:
    return [
        "[[objects]]",
        f"body = {_toml(body.key)}",
        f"mesh = {_toml(mesh)}   # guessed: a file in this folder, or the name of a library object"
        if mesh in library_names()
        else f"mesh = {_toml(mesh)}   # a file in this folder, or the name of a library object",
    ]


def _words(name: str | None) -> list[str]:
    return [word.lower() for word in _WORDS.findall(name or "")]


def _is_named(name: str | None, part: str) -> bool:
    words = set(_words(name))
    side = words & _SIDES[part]
    return bool(side and words & _HANDS) or (words in ({"left"}, {"right"}) and bool(side))


def likely_mesh(name: str | None) -> str | None:
    """The object of the library that a body's name suggests, or None."""
    words = _words(name)
    joined = "_".join(words)
    known = [mesh for mesh in library_names() if mesh in joined or mesh in words]
    return known[0] if known else next((_SYNONYMS[word] for word in words if word in _SYNONYMS), None)


def _toml(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)
