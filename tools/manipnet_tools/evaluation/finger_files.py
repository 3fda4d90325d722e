"""Hands from files that `manipnet synthesize` wrote, as rows of an evaluation."""

from collections.abc import Callable, Sequence
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from manipnet.geometry import SIDES
from manipnet.tracking.tick import TICK_HZ
from manipnet_tools.evaluation.cases import Case
from manipnet_tools.evaluation.results import Fold, Hands
from manipnet_tools.takes.dataset import DataError


def finger_files(texts: Sequence[str], takes: Sequence[str]) -> dict[str, Path]:
    """Files by take from `--fingers TAKE=FILE.npz`, where TAKE is one of `takes`. Raises `DataError`."""
    files: dict[str, Path] = {}
    for text in texts:
        take, _, file = text.partition("=")
        if not (take and file):
            raise DataError(f"--fingers {text}: must be TAKE=FILE.npz, for example mug1=fingers.npz")
        if take not in takes:
            raise DataError(f"--fingers {text}: the dataset has no take {take!r}; it has {', '.join(takes)}")
        files[take] = Path(file)
    return files


def fingers_of(files: dict[str, Path]) -> Callable[[Fold, Callable[[int], None]], list[Hands]]:
    """The row of an evaluation that reads these files, by take."""
    return lambda fold, advance: [read_fingers(files[case.name], case) for case in fold.test]


def read_fingers(path: Path, case: Case) -> Hands:
    """The hands in a file at the ticks of a case. Raises `DataError` if the file lacks arrays or ticks."""
    wanted = ("time", *(f"{side}_positions" for side in SIDES))
    try:
        with np.load(path, allow_pickle=False) as arrays:
            time_s, *world = (arrays[name] for name in wanted)
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        raise DataError(f"{path}: is not a file of manipnet synthesize ({error})") from None
    index = np.searchsorted(time_s, case.ticks.time_s - 0.5 / TICK_HZ)
    if index[-1] >= len(time_s) or np.abs(time_s[index] - case.ticks.time_s).max() > 0.5 / TICK_HZ:
        raise DataError(
            f"{path}: holds {time_s[0]:.2f} to {time_s[-1]:.2f} s; {case.name} is judged from "
            f"{case.ticks.time_s[0]:.2f} to {case.ticks.time_s[-1]:.2f} s, 60 times a second"
        )
    return {side: case.in_wrist(side, p[index]) for side, p in zip(SIDES, world, strict=True)}
