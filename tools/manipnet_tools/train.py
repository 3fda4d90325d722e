"""Training: from published takes to a shipped bundle."""

import hashlib
import json
import logging
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path
from typing import cast

import numpy as np
import torch

from manipnet.geometry import Array
from manipnet.hand.skeleton import DOF_NAMES
from manipnet.network.bundle import FORMAT
from manipnet.network.decode import angles_from_outputs
from manipnet.network.layout import describe
from manipnet_tools.compress import halve_weights
from manipnet_tools.dataset import TICK_FRAMES, HandTrack, Samples, concatenate, load_tracks
from manipnet_tools.model import Architecture, ManipNet, export_onnx, normalisation
from manipnet_tools.perturb import Lesson, captured_samples, self_made_samples

_log = logging.getLogger(__name__)

LICENCE = "CC BY-NC 4.0; trained on the ManipNet dataset by He Zhang, Yuting Ye, Takaaki Shiratori and Taku Komura"
LIMIT_MARGIN_RAD = np.radians(7.0)
FUTURE_FRAMES = 60
"""Windows reach this far: samples end before a span's end, so that no test frame is seen in training."""


@dataclass(frozen=True)
class TrainConfig:
    """What is trained and how. Defaults are those of the shipped bundles."""

    width: int = 384
    architecture: Architecture = "manipnet"
    carries_pose: bool = False
    """Predict the change of the pose, in units of its own deviation, instead of the pose."""
    hidden: tuple[str, ...] = ()
    """Inputs the network does not see: names of blocks, or `future`."""
    dropout: float = 0.3
    rounds: int = 4
    """New samples are made this often."""
    epochs_per_round: int = 5
    batch: int = 128
    learning_rate: float = 7e-4
    weight_decay: float = 1e-2
    average: float = 0.999
    """Decay of the running average of the weights, which is what is shipped; 0 ships the last weights."""
    kept: float = 0.0
    """Share of a pose error that may remain after one tick."""
    response: float = 0.4
    """Share of the way to the answer that a hand goes in one tick; the answer leads by what that lags."""
    blended: float = 0.6
    """Samples at blended poses, per captured frame and round."""
    self_made: float = 0.4
    """Samples at the model's own poses, per captured frame and round."""
    roll_out_ticks: int = 40
    warp: float = 0.2
    captured: float = 0.3
    """Samples at captured poses, per captured frame and round."""
    backwards: bool = True
    """Learn every take played backwards as well: taking hold and letting go are each other's mirror images in time."""
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Trained:
    """A trained model with what a bundle needs besides."""

    model: ManipNet
    rest_angles: Array
    limits: Array
    config: TrainConfig
    takes: tuple[str, ...]
    share: float
    """Share of each take that was seen, from its start."""
    seconds: float


def spans_of(tracks: Sequence[HandTrack], share: float) -> list[tuple[int, int]]:
    """Frames of each track that training may use: the first `share` of it, windows included."""
    return [(FUTURE_FRAMES, int(len(track) * share) - FUTURE_FRAMES) for track in tracks]


def train(tracks: Sequence[HandTrack], config: TrainConfig, share: float = 1.0) -> Trained:
    """Train on the first `share` of each track. Deterministic for a seed, on one thread: with the small batches that
    train best, a second thread waits more than it works."""
    started = time.monotonic()
    takes = tuple(sorted({track.name.split("/")[0] for track in tracks}))
    spans = spans_of(tracks, share)
    if config.backwards:
        spans += [(len(track) - high, len(track) - low) for track, (low, high) in zip(tracks, spans, strict=True)]
        tracks = [*tracks, *(track.backwards() for track in tracks)]
    torch.set_num_threads(1)
    torch.manual_seed(config.seed)
    rng = np.random.default_rng(config.seed)
    pool = np.concatenate([track.angles[low:high:4] for track, (low, high) in zip(tracks, spans, strict=True)])
    limits = pose_limits(pool)
    rest = np.clip(pool.mean(axis=0), limits[:, 0], limits[:, 1])
    first = _make(tracks, spans, config, pool, limits, rng, None)
    norm = normalisation(first.inputs, first.outputs, config.carries_pose)
    model = ManipNet(norm, config.width, config.dropout, config.architecture, config.hidden)
    average = torch.optim.swa_utils.AveragedModel(
        model, multi_avg_fn=torch.optim.swa_utils.get_ema_multi_avg_fn(config.average)
    )
    optimizer = torch.optim.AdamW(
        model.parameters(), config.learning_rate, weight_decay=config.weight_decay, fused=True
    )
    total = config.rounds * config.epochs_per_round
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, total, config.learning_rate / 50)
    for turn in range(config.rounds):
        policy = None if turn == 0 else policy_of(cast(ManipNet, average.module), limits)
        samples = first if turn == 0 else _make(tracks, spans, config, pool, limits, rng, policy)
        for _ in range(config.epochs_per_round):
            loss = _epoch(model, average, optimizer, samples, config.batch, rng)
            schedule.step()
        _log.info(
            "round %d/%d  %d samples  loss %.4f  %.0f s",
            turn + 1, config.rounds, len(samples), loss, time.monotonic() - started,
        )  # fmt: skip
    shipped = cast(ManipNet, average.module) if config.average else model
    return Trained(shipped.eval(), rest, limits, config, takes, share, time.monotonic() - started)


def pose_limits(angles: Array) -> Array:
    """Limits `(20, 2)`: the 0.5 and 99.5 percentiles of `angles (N, 20)`, widened by seven degrees."""
    low, high = np.percentile(angles, [0.5, 99.5], axis=0)
    return np.stack([low - LIMIT_MARGIN_RAD, high + LIMIT_MARGIN_RAD], axis=1)


def policy_of(model: ManipNet, limits: Array):
    """The model as a function from features to angles."""
    model.eval()

    def policy(rows: np.ndarray) -> Array:
        with torch.no_grad(), torch.autocast("cpu", torch.bfloat16):
            outputs = model(torch.from_numpy(rows))
        return angles_from_outputs(outputs.double().numpy(), limits)

    return policy


def _make(tracks, spans, config: TrainConfig, pool: Array, limits: Array, rng, policy) -> Samples:
    """One round's samples: captured, blended and, with a policy, self-made poses."""
    lag_ticks = (1.0 - config.response) / config.response
    lesson = Lesson(config.kept, TICK_FRAMES * lag_ticks, config.response)
    parts = []
    for track, (low, high) in zip(tracks, spans, strict=True):
        for share, towards in ((config.captured, None), (config.blended, pool)):
            if share:
                frames = rng.integers(low, high, int(share * (high - low)))
                parts.append(captured_samples(track, frames, towards, lesson, limits, rng, config.warp))
    if policy is not None and config.self_made:
        wanted = config.self_made * np.mean([high - low for low, high in spans])
        starts = max(int(wanted / config.roll_out_ticks), 1)
        parts.append(self_made_samples(tracks, spans, policy, starts, config.roll_out_ticks, lesson, pool, limits, rng))
    return concatenate(parts)


def _epoch(model, average, optimizer, samples: Samples, batch: int, rng) -> float:
    model.train()
    order = rng.permutation(len(samples))
    losses = []
    for start in range(0, len(order) - batch + 1, batch):
        rows = order[start : start + batch]
        inputs, outputs = torch.from_numpy(samples.inputs[rows]), torch.from_numpy(samples.outputs[rows])
        with torch.autocast("cpu", torch.bfloat16):
            predicted = model.normalised(inputs).float()
        target = model.normalise_outputs(inputs, outputs)
        error = predicted - target
        loss = (error * error).mean()
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()
        average.update_parameters(model)
        losses.append(float(loss.detach()))
    return float(np.mean(losses))


def save_bundle(trained: Trained, folder: Path) -> None:
    """Write `manipnet.onnx` and `bundle.json`."""
    folder.mkdir(parents=True, exist_ok=True)
    content = halve_weights(export_onnx(trained.model))
    (folder / "manipnet.onnx").write_bytes(content)
    meta = {
        "format": FORMAT,
        "layout": describe(),
        "dofs": list(DOF_NAMES),
        "rest_angles_rad": [round(float(a), 6) for a in trained.rest_angles],
        "response": trained.config.response,
        "limits_rad": np.round(trained.limits, 6).tolist(),
        "model_sha256": hashlib.sha256(content).hexdigest(),
        "training": {
            **asdict(trained.config),
            "takes": list(trained.takes),
            "share": trained.share,
            "minutes": round(trained.seconds / 60, 1),
            "date": date.today().isoformat(),
        },
        "licence": LICENCE,
    }
    (folder / "bundle.json").write_text(json.dumps(meta, indent=1) + "\n", encoding="utf-8")


@dataclass(frozen=True)
class TrainOptions:
    """Train a model on the published takes.

    Example: manipnet train --data DATA --out models/mine --leave-out mug1
    """

    data: Path
    """Folder with `BVH/` and `meshes/`."""
    out: Path
    """Folder of the bundle to write."""
    leave_out: tuple[str, ...] = ()
    """Takes not to train on."""
    share: float = 1.0
    """Train on this share of each take, from its start; 0.8 leaves what `manipnet evaluate` tests as seen."""
    training: TrainConfig = TrainConfig()


def run(options: TrainOptions) -> None:
    """Train and write the bundle. Raises `ValueError` where there is nothing to train on."""
    names = [path.name for path in sorted((options.data / "BVH").glob("*")) if path.name not in options.leave_out]
    if not names:
        raise ValueError(f"{options.data}: no takes in its BVH folder, or all of them left out")
    save_bundle(train(load_tracks(options.data, names), options.training, options.share), options.out)
