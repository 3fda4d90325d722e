"""Which of the bodies that were heard are wrists, by their names or else by how far they moved, and a rig of it."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from manipnet.config.settings import WRISTS, BodyKey, ConfigError
from manipnet.synthesis.objects.library import library_names
from manipnet.wire.bodies import BodyFrame, BodySample

STEP_M: Final = 0.005
"""Motion is counted in steps of this: a tracker's noise makes none."""
MOVED_M: Final = 0.3
"""A wrist that was waved has gone at least this far."""
_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_SIDES = {"left_wrist": {"left", "l", "lft"}, "right_wrist": {"right", "r", "rgt"}}
_HANDS = {"wrist", "hand", "glove", "palm"}
_ALSO_CALLED = {
    "box": "cube",
    "crate": "cube",
    "ball": "sphere",
    "cup": "mug",
    "can": "cylinder",
    "glass": "wine_glass",
}


@dataclass(slots=True)
class HeardBody:
    """One body of the stream: its key for a rig, and how far it went."""

    id: int | None
    name: str | None
    moved_m: float = 0.0
    tracked: int = 0
    _anchor: np.ndarray | None = field(default=None, repr=False)

    @property
    def key(self) -> BodyKey:
        """Its name, which people can read, else its id."""
        return self.name if self.name else self.id if self.id is not None else ""

    def add(self, sample: BodySample) -> None:
        """Take one sample."""
        if not sample.tracked:
            return
        self.tracked += 1
        here = np.array(sample.p)
        step_m = 0.0 if self._anchor is None else float(np.linalg.norm(here - self._anchor))
        if self._anchor is None or step_m >= STEP_M:
            self._anchor, self.moved_m = here, self.moved_m + step_m


class Listener:
    """Takes frames as a sink, from any thread."""

    def __init__(self) -> None:
        self.bodies: dict[tuple[int | None, str | None], HeardBody] = {}

    def __call__(self, frame: BodyFrame) -> None:
        for sample in frame.bodies:
            self.bodies.setdefault((sample.id, sample.name), HeardBody(sample.id, sample.name)).add(sample)


@dataclass(frozen=True)
class Guess:
    """Who is who, and why: `wrists` by part."""

    wrists: dict[str, tuple[BodyKey, str]]
    others: tuple[HeardBody, ...]


def guess(bodies: Sequence[HeardBody], said: dict[str, BodyKey]) -> Guess:
    """Wrists as `said`, else by name, else the two that moved most, the right one more than the left.

    Raises `ConfigError` when there is no telling.
    """
    wrists: dict[str, tuple[BodyKey, str]] = {part: (key, "as said") for part, key in said.items()}
    left = {body.key: body for body in bodies if body.key not in said.values()}
    for part in WRISTS:
        named = [key for key, body in left.items() if _named(body.name, part)]
        if part not in wrists and named:
            wrists[part] = named[0], "by its name"
            del left[named[0]]
    missing = [part for part in reversed(WRISTS) if part not in wrists]
    waved = sorted((body for body in left.values() if body.moved_m >= MOVED_M), key=lambda body: -body.moved_m)
    for part, body in zip(missing, waved, strict=False):
        wrists[part] = body.key, f"it moved {body.moved_m:.1f} m: see that left and right are not swapped"
        del left[body.key]
    if not wrists:
        heard = ", ".join(str(body.key) for body in bodies) or "none"
        raise ConfigError(
            f"no body is a wrist by its name, and none was waved (heard: {heard}); wave both hands while it listens, "
            "the right one more, or say --left-wrist BODY --right-wrist BODY"
        )
    return Guess({part: wrists[part] for part in WRISTS if part in wrists}, tuple(left.values()))


def rig_of(found: Guess, server: dict[str, object]) -> str:
    """The text of a rig file. Bodies nobody knows stay in it as comments."""
    lines = ["# Written by `manipnet rig init`; see docs/rig.md.", "[bodies]"]
    lines += [f"{part} = {_toml(key)}   # {why}" for part, (key, why) in found.wrists.items()]
    for body in found.others:
        mesh = _mesh(body.name)
        lines += [
            "",
            *(_object(body, mesh) if mesh else [f"# {line}" for line in _object(body, "mesh of your own.obj")]),
        ]
    if server:
        lines += ["", "[server]", *(f"{key} = {_toml(value)}" for key, value in server.items())]
    return "\n".join(lines) + "\n"


def _object(body: HeardBody, mesh: str) -> list[str]:
    return [
        "[[objects]]",
        f"body = {_toml(body.key)}",
        f"mesh = {_toml(mesh)}   # a file beside this one, or of the library",
    ]


def _words(name: str | None) -> list[str]:
    return [word.lower() for word in _WORDS.findall(name or "")]


def _named(name: str | None, part: str) -> bool:
    words = set(_words(name))
    side = words & _SIDES[part]
    return bool(side and words & _HANDS) or (words in ({"left"}, {"right"}) and bool(side))


def _mesh(name: str | None) -> str | None:
    words = _words(name)
    spelt = "_".join(words)
    known = [mesh for mesh in library_names() if mesh in spelt or mesh in words]
    return known[0] if known else next((_ALSO_CALLED[word] for word in words if word in _ALSO_CALLED), None)


def _toml(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)
