"""`manipnet ablate`: the rows of the paper's Table 1, trained alike and tested on both protocols.

All rows of a fold learn from the same samples for the same time. There are no on-policy samples, so that rows differ
only in what they see and how they are built.
"""

import json
import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from rich.progress import Progress

from manipnet.synthesis.model.bundle import Bundle, load_bundle
from manipnet_tools.evaluation import report
from manipnet_tools.evaluation.cases import SEEN_SHARE, load_cases
from manipnet_tools.evaluation.options import AblateOptions
from manipnet_tools.evaluation.results import Fold
from manipnet_tools.evaluation.roll_outs import baseline_rows, evaluate, folds, model_rows
from manipnet_tools.takes.dataset import take_folders
from manipnet_tools.terminal import open_console
from manipnet_tools.training.dataset import CapturedHand, TakeSet, load_captured_hands
from manipnet_tools.training.sampler import RoundSampler
from manipnet_tools.training.train import Trainer, new_model, trained
from manipnet_tools.training.trained import save_bundle

_log = logging.getLogger(__name__)

SENSORS = ("ambient", "proximity", "signed_distances", "surface_normals")
ROWS: dict[str, dict[str, Any]] = {
    "ours": {},
    "no sensors": {"hidden": SENSORS},
    "no ambient": {"hidden": SENSORS[:1]},
    "no distance": {"hidden": SENSORS[1:]},
    "short trajectory": {"hidden": ("future",)},
    "ResNet": {"architecture": "resnet"},
    "MLP": {"architecture": "mlp"},
}
"""The paper's rows, except the raw data, which are the captured fingers."""


def run(options: AblateOptions) -> None:
    """Train the rows that are missing, evaluate all, print and write the figures. Raises `DataError`."""
    console = open_console(stderr=False)
    cases = load_cases(options.data)
    names = [folder.name for folder in take_folders(options.data)]
    hands = load_captured_hands(options.data)
    for protocol in options.protocol:
        tests = folds(cases, protocol, names)
        for fold in tests:
            train_rows(_hands_of(fold, hands), options, fold.name, SEEN_SHARE if protocol == "seen" else 1.0)
        models = {row: lambda fold, row=row: _bundle(options.out, row, fold.name) for row in ROWS}
        with Progress(console=console) as progress:
            sources = model_rows(models, ("least_squares", "none")) | baseline_rows(models["ours"])
            results = evaluate(tests, protocol, sources, progress)
        for table in report.tables(results, "ours, least squares", {}):
            console.print(table)
        content = report.as_json(results, "ours, least squares", {})
        (options.out / f"{protocol}.json").write_text(json.dumps(content, indent=1), encoding="utf-8")


def _hands_of(fold: Fold, hands: Sequence[CapturedHand]) -> list[CapturedHand]:
    names = {case.name for case in fold.train}
    return [captured for captured in hands if captured.name.split("/")[0] in names]


def _bundle(out: Path, row: str, fold: str) -> Bundle:
    return load_bundle(folder_of(out, row, fold))


def folder_of(out: Path, row: str, fold: str) -> Path:
    """The folder of a row's bundle for a fold."""
    return out / row.replace(" ", "-").lower() / fold


def train_rows(hands: Sequence[CapturedHand], options: AblateOptions, fold: str, share: float) -> None:
    """Train the rows of a fold that are missing, all on the same samples."""
    wanted = [row for row in ROWS if not (folder_of(options.out, row, fold) / "bundle.json").is_file()]
    if not wanted:
        return
    torch.set_num_threads(1)
    configs = {row: replace(options.training, **ROWS[row]) for row in wanted}
    sets = [TakeSet(hands)]
    sampler = RoundSampler(sets, options.training, share)
    trainers: dict[str, Trainer] = {}
    for turn in range(options.training.rounds):
        samples = sampler.next_round(None)
        for row, config in configs.items():
            if not turn:
                torch.manual_seed(config.seed)
                trainers[row] = Trainer(new_model(sampler.hand, samples, config), config)
            loss = trainers[row].learn(samples)
            _log.info("%s  %s  round %d/%d  loss %.4f", fold, row, turn + 1, config.rounds, loss)
    for row, trainer in trainers.items():
        save_bundle(trained(trainer, sampler, sets, configs[row], share, 0.0), folder_of(options.out, row, fold))
