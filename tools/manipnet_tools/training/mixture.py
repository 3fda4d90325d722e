"""The folders of takes that a model is trained on, and how much each of them counts: `--data FOLDER[=WEIGHT]`."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from manipnet_tools.takes.dataset import DataError, take_folders
from manipnet_tools.takes.sources import foreign_terms, join_licences, licence_of


@dataclass(frozen=True)
class DataFolder:
    """Takes of one folder."""

    path: Path
    weight: float
    """A folder gives samples in proportion to its weight, however long its takes are."""
    takes: tuple[str, ...]
    """Names of the takes to use."""


def data_folders(texts: Sequence[str], leave_out: Sequence[str]) -> tuple[DataFolder, ...]:
    """The folders that `--data` names, without the takes that `--leave-out` names.

    Raises `DataError` for a folder without takes, a weight that is not a positive number, or a take in no folder.
    """
    if not texts:
        raise DataError("--data: names no folder")
    named = [_path_and_weight(text) for text in texts]
    if len({path.resolve() for path, _ in named}) < len(named):
        raise DataError("--data: names a folder twice; give it once, with a weight")
    found = {path: [folder.name for folder in take_folders(path)] for path, _ in named}
    if unknown := set(leave_out) - {name for names in found.values() for name in names}:
        where = "; ".join(f"the takes of {path} are {_listed(names)}" for path, names in found.items())
        raise DataError(f"--leave-out {min(unknown)}: {where}")
    left = {path: tuple(name for name in names if name not in leave_out) for path, names in found.items()}
    if empty := [path for path, names in left.items() if not names]:
        raise DataError(f"--leave-out names every take of {empty[0]}; leave some to train on")
    return tuple(DataFolder(path, weight, left[path]) for path, weight in named)


def licence_of_mixture(folders: Sequence[DataFolder], start: str | None) -> str:
    """The terms of a model that is trained on these folders, from a bundle under the terms `start` if there is one.

    Raises `DataError`.
    """
    licences = [] if start is None else [start]
    return join_licences([*licences, *(licence_of(folder.path, folder.takes) for folder in folders)])


def require_free(licence: str) -> None:
    """Raise `DataError` if these terms forbid commercial use or do not say that they allow it."""
    if foreign := foreign_terms(licence):
        raise DataError(
            f"--free: the model could not be used commercially, because of: {' | '.join(foreign)}. Leave out these "
            f"takes, start from another bundle, or train without --free"
        )


def _path_and_weight(text: str) -> tuple[Path, float]:
    path, equals, number = text.rpartition("=")
    if not equals or Path(text).is_dir():
        return Path(text), 1.0
    try:
        weight = float(number)
    except ValueError:
        weight = math.nan
    if not (math.isfinite(weight) and weight > 0.0):
        raise DataError(f"--data {text}: the weight is {number!r}; it must be a number above 0, as in generated=2")
    return Path(path), weight


def _listed(names: Sequence[str]) -> str:
    """Names for a message; a generated set has thousands."""
    return ", ".join(names) if len(names) <= 12 else f"{names[0]} to {names[-1]}"
