"""`manipnet ablate`: the rows of the paper's Table 1, trained alike and tested on both protocols.

Every row of a fold learns from the same samples for as long, without samples of its own making, so that rows differ in
what they see and how they are built and in nothing else.
"""

import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from rich.progress import Progress

from manipnet.synthesis.model.bundle import Bundle, load_bundle
from manipnet_tools.evaluation import report
from manipnet_tools.evaluation.cases import data_folders, load_cases
from manipnet_tools.evaluation.results import Fold, Protocol
from manipnet_tools.evaluation.roll_outs import evaluate, folds
from manipnet_tools.terminal import open_console
from manipnet_tools.training.dataset import HandTrack, load_tracks
from manipnet_tools.training.train import Learner, Lessons, TrainConfig, save_bundle, trained

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
"""The paper's rows but raw data, which are the captured fingers."""
PROTOCOLS: tuple[Protocol, ...] = ("seen", "unseen")
_SEEN_SHARE = 0.8


TRAINING = TrainConfig(
    architecture="manipnet", rounds=1, epochs_per_round=6, self_made=0.0, huber=0.0, average=0.99, response=0.4
)
"""The paper's network, and shorter than a shipped bundle's: 49 models are to be trained."""


@dataclass(frozen=True)
class AblateOptions:
    """Train and test the paper's ablation: tables in the terminal, figures in OUT.

    Example: manipnet ablate --data DATA --out ablation
    """

    data: Path
    """Folder with `BVH/` and `meshes/`."""
    out: Path
    """Folder for the bundles (those that are there are used again) and `seen.json`, `unseen.json`."""
    protocol: tuple[Protocol, ...] = PROTOCOLS
    training: TrainConfig = TRAINING


def run(options: AblateOptions) -> None:
    """Train what is missing, evaluate every row, print and write the figures. Raises `DataError`."""
    console = open_console(stderr=False)
    cases = load_cases(options.data)
    names = [folder.name for folder in data_folders(options.data)]
    tracks = load_tracks(options.data)
    for protocol in options.protocol:
        tests = folds(cases, protocol, names)
        for fold in tests:
            train_rows(_tracks_of(fold, tracks), options, fold.name, _SEEN_SHARE if protocol == "seen" else 1.0)
        models = {row: lambda fold, row=row: _bundle(options.out, row, fold.name) for row in ROWS}
        with Progress(console=console) as progress:
            results = evaluate(tests, protocol, models, ("least_squares", "none"), progress)
        for table in report.tables(results, "ours, least squares"):
            console.print(table)
        content = report.as_json(results, "ours, least squares")
        (options.out / f"{protocol}.json").write_text(json.dumps(content, indent=1), encoding="utf-8")


def _tracks_of(fold: Fold, tracks: Sequence[HandTrack]) -> list[HandTrack]:
    names = {case.name for case in fold.train}
    return [track for track in tracks if track.name.split("/")[0] in names]


def _bundle(out: Path, row: str, fold: str) -> Bundle:
    return load_bundle(folder_of(out, row, fold))


def folder_of(out: Path, row: str, fold: str) -> Path:
    """Where a row's bundle of a fold is kept."""
    return out / row.replace(" ", "-").lower() / fold


def train_rows(tracks: Sequence[HandTrack], options: AblateOptions, fold: str, share: float) -> None:
    """Train the rows that are missing, all on the same samples."""
    wanted = [row for row in ROWS if not (folder_of(options.out, row, fold) / "bundle.json").is_file()]
    if not wanted:
        return
    torch.set_num_threads(1)
    configs = {row: replace(options.training, **ROWS[row]) for row in wanted}
    lessons = Lessons(tracks, options.training, share)
    learners: dict[str, Learner] = {}
    for turn in range(options.training.rounds):
        samples = lessons.next_round(None)
        for row, config in configs.items():
            if not turn:
                torch.manual_seed(config.seed)
                learners[row] = Learner(lessons.hand, samples, config)
            loss = learners[row].learn(samples)
            _log.info("%s  %s  round %d/%d  loss %.4f", fold, row, turn + 1, config.rounds, loss)
    for row, learner in learners.items():
        save_bundle(trained(learner, lessons, tracks, configs[row], share, 0.0), folder_of(options.out, row, fold))
