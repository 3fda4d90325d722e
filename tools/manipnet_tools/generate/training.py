"""Trains a free model on a generated set, by the recipe of `manipnet-open`."""

import importlib
from dataclasses import replace
from pathlib import Path

from manipnet_tools.training.config import FOR_GENERATED
from manipnet_tools.training.options import TrainOptions


def require_training() -> None:
    """Raise `ModuleNotFoundError` now, rather than after hours of generation, if training cannot run."""
    importlib.import_module("manipnet_tools.training.train")


def train_on(data: Path, out: Path, seed: int) -> None:
    """Train on all takes of `data` and write the bundle. Raises `DataError`, `TakeError`, `MeshError` and `OSError`."""
    from manipnet_tools.training.train import run

    options = TrainOptions(data=(str(data),), out=out, free=True, training=replace(FOR_GENERATED, seed=seed))
    options.check()
    run(options)
