"""Records where the takes of a folder come from and under which licence: `sources.json` beside the dataset's folders.

A folder without the file is the ManipNet dataset itself.
"""

import json
from collections.abc import Collection, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from manipnet.geometry import SIDES, Side
from manipnet_tools.takes.dataset import DataError

SOURCES_FILE: Final = "sources.json"
FREE_LICENCES: Final = ("Apache-2.0", "MIT", "BSD-3-Clause", "CC0-1.0", "CC BY 4.0")
"""Licences that allow commercial use; the last one for credit."""
_BETWEEN: Final = " | "
_TRAINED_ON: Final = "; trained on "
MANIPNET_LICENCE: Final = (
    "CC BY-NC 4.0; trained on the ManipNet dataset by He Zhang, Yuting Ye, Takaaki Shiratori and Taku Komura"
)


@dataclass(frozen=True)
class TakeSource:
    """Where one take comes from."""

    name: str
    """The set."""
    licence: str
    attribution: str
    url: str
    original: str
    """The take's name in the set."""
    hands: tuple[Side, ...]
    """The hands that were captured."""
    error_mm: dict[str, float]
    """Median distance between the joints of the set and of the model's hand, by side."""


def read_sources(data: Path) -> dict[str, TakeSource]:
    """The sources of the takes in a folder, by take. Raises `DataError` for a damaged file."""
    path = data / SOURCES_FILE
    if not path.is_file():
        return {}
    try:
        takes: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))["takes"]
        return {name: TakeSource(**{**entry, "hands": tuple(entry["hands"])}) for name, entry in takes.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise DataError(f"{path}: is damaged ({error}); import the takes again") from None


def add_sources(data: Path, takes: dict[str, TakeSource]) -> None:
    """Add takes to the file. Raises `DataError` and `OSError`."""
    content = {name: asdict(source) for name, source in sorted((read_sources(data) | takes).items())}
    (data / SOURCES_FILE).write_text(json.dumps({"takes": content}, indent=1) + "\n", encoding="utf-8")


def captured_sides(data: Path, take: str) -> tuple[Side, ...]:
    """The hands of a take that were captured. Raises `DataError`."""
    source = read_sources(data).get(take)
    return SIDES if source is None else source.hands


def licence_of(data: Path, takes: Collection[str]) -> str:
    """The terms of a model that is trained on some takes of a folder. Raises `DataError`."""
    sources = read_sources(data)
    texts = (
        MANIPNET_LICENCE
        if (source := sources.get(take)) is None
        else f"{source.licence}{_TRAINED_ON}{source.name}" + (f" by {source.attribution}" if source.attribution else "")
        for take in takes
    )
    return join_licences(texts) or MANIPNET_LICENCE


def join_licences(licences: Iterable[str]) -> str:
    """The terms of several sources as one text, each once."""
    return _BETWEEN.join(dict.fromkeys(part for text in licences for part in text.split(_BETWEEN)))


def foreign_terms(licence: str) -> list[str]:
    """The parts of such a text that forbid commercial use or do not say that they allow it."""
    return [part for part in licence.split(_BETWEEN) if part.partition(_TRAINED_ON)[0].strip() not in FREE_LICENCES]
