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
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.hand_file import HAND_FILE, write_hand
from manipnet.synthesis.model.bundle import FORMAT
from manipnet.synthesis.model.decode import angles_from_outputs
from manipnet.synthesis.model.layout import layout_of
from manipnet_tools.training.augment import Lesson, captured_samples, self_made_samples
from manipnet_tools.training.dataset import TICK_FRAMES, HandTrack, Samples, concatenate, load_tracks
from manipnet_tools.training.model import Architecture, ManipNet, export_onnx, normalisation
from manipnet_tools.training.quantise import halve_weights

_log = logging.getLogger(__name__)

LICENCE = "CC BY-NC 4.0; trained on the ManipNet dataset by He Zhang, Yuting Ye, Takaaki Shiratori and Taku Komura"
LIMIT_MARGIN_RAD = np.radians(7.0)
FUTURE_FRAMES = 60
"""Windows reach this far: samples end before a span's end, so that no test frame is seen in training."""


@dataclass(frozen=True)
class TrainConfig:
    """What is trained and how. Defaults are those of the shipped bundles."""

    width: int = 384
    architecture: Architecture = "resnet"
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
    huber: float = 0.5
    """Errors beyond this many deviations count by their size, not its square; 0 squares all."""
    average: float = 0.999
    """Decay of the running average of the weights, which is what is shipped; 0 ships the last weights."""
    kept: float = 0.0
    """Share of a pose error that may remain after one tick."""
    response: float = 0.5
    """Share of the way to the answer that a hand goes in one tick; the answer leads by what that lags."""
    blended: float = 0.6
    """Samples at blended poses, per captured frame and round."""
    self_made: float = 0.4
    """Samples at the model's own poses, per captured frame and round."""
    roll_out_ticks: int = 40
    warp: float = 0.2
    captured: float = 0.3
    """Samples at captured poses, per captured frame and round."""
    backwards: bool = False
    """Learn every take played backwards as well."""
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Trained:
    """A trained model with what a bundle needs besides."""

    model: ManipNet
    hand: Hand
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


class Learner:
    """One model in training: `learn` from samples, round by round, at a falling rate."""

    def __init__(self, hand: Hand, first: Samples, config: TrainConfig) -> None:
        """`first` samples give the normalisation."""
        layout = layout_of(hand)
        norm = normalisation(layout, first.inputs, first.outputs, config.carries_pose)
        self._config = config
        self._rng = np.random.default_rng(config.seed)
        self._last = ManipNet(layout, norm, config.width, config.dropout, config.architecture, config.hidden)
        self._average = torch.optim.swa_utils.AveragedModel(
            self._last, multi_avg_fn=torch.optim.swa_utils.get_ema_multi_avg_fn(config.average)
        )
        self._optimizer = torch.optim.AdamW(
            self._last.parameters(), config.learning_rate, weight_decay=config.weight_decay, fused=True
        )
        total = config.rounds * config.epochs_per_round
        self._schedule = torch.optim.lr_scheduler.CosineAnnealingLR(self._optimizer, total, config.learning_rate / 50)

    @property
    def model(self) -> ManipNet:
        """What would be shipped now."""
        return cast(ManipNet, self._average.module) if self._config.average else self._last

    def learn(self, samples: Samples) -> float:
        """One round's epochs; returns the last one's loss."""
        loss = float("nan")
        for _ in range(self._config.epochs_per_round):
            loss = self._epoch(samples)
            self._schedule.step()
        return loss

    def _epoch(self, samples: Samples) -> float:
        self._last.train()
        batch, order, losses = self._config.batch, self._rng.permutation(len(samples)), []
        for start in range(0, len(order) - batch + 1, batch):
            rows = order[start : start + batch]
            inputs, outputs = torch.from_numpy(samples.inputs[rows]), torch.from_numpy(samples.outputs[rows])
            with torch.autocast("cpu", torch.bfloat16):
                predicted = self._last.normalised(inputs).float()
            loss = self._loss(predicted, self._last.normalise_outputs(inputs, outputs))
            self._optimizer.zero_grad(set_to_none=True)
            loss.backward()
            self._optimizer.step()
            self._average.update_parameters(self._last)
            losses.append(float(loss.detach()))
        return float(np.mean(losses))

    def _loss(self, predicted: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
        if self._config.huber:
            return torch.nn.functional.huber_loss(predicted, wanted, delta=self._config.huber)
        return torch.nn.functional.mse_loss(predicted, wanted)


class Lessons:
    """Samples of some takes, made anew for every round."""

    def __init__(self, tracks: Sequence[HandTrack], config: TrainConfig, share: float) -> None:
        """The first `share` of every track is used."""
        self._spans = spans_of(tracks, share)
        self._tracks, self._config = list(tracks), config
        self.hand = tracks[0].hand
        self._rng = np.random.default_rng(config.seed)
        seen = [track.angles[low:high:4] for track, (low, high) in zip(tracks, self._spans, strict=True)]
        self._pool = np.concatenate(seen)
        self.limits = pose_limits(self._pool)
        self.rest_angles = np.clip(self._pool.mean(axis=0), self.limits[:, 0], self.limits[:, 1])
        if config.backwards:
            self._spans += [
                (len(track) - high, len(track) - low) for track, (low, high) in zip(tracks, self._spans, strict=True)
            ]
            self._tracks += [track.backwards() for track in tracks]

    def next_round(self, model: ManipNet | None) -> Samples:
        """Captured and blended poses and, given a model, poses of its own making."""
        config, rng = self._config, self._rng
        lag_ticks = (1.0 - config.response) / config.response
        lesson = Lesson(config.kept, TICK_FRAMES * lag_ticks, config.response)
        parts = []
        for track, (low, high) in zip(self._tracks, self._spans, strict=True):
            for share, towards in ((config.captured, None), (config.blended, self._pool)):
                if share:
                    frames = rng.integers(low, high, int(share * (high - low)))
                    parts.append(captured_samples(track, frames, towards, lesson, self.limits, rng, config.warp))
        if model is not None and config.self_made:
            parts.append(self._self_made(model, lesson))
        return concatenate(parts)

    def _self_made(self, model: ManipNet, lesson: Lesson) -> Samples:
        config = self._config
        wanted = config.self_made * np.mean([high - low for low, high in self._spans])
        starts = max(int(wanted / config.roll_out_ticks), 1)
        policy = policy_of(model, self.hand, self.limits)
        return self_made_samples(
            self._tracks, self._spans, policy, starts, config.roll_out_ticks, lesson, self._pool, self.limits, self._rng
        )


def train(tracks: Sequence[HandTrack], config: TrainConfig, share: float = 1.0) -> Trained:
    """Train on the first `share` of each track. Deterministic for a seed, on one thread: with the small batches that
    train best, a second thread waits more than it works."""
    started = time.monotonic()
    torch.set_num_threads(1)
    torch.manual_seed(config.seed)
    lessons = Lessons(tracks, config, share)
    samples = lessons.next_round(None)
    learner = Learner(lessons.hand, samples, config)
    for turn in range(config.rounds):
        if turn:
            samples = lessons.next_round(learner.model)
        loss = learner.learn(samples)
        _log.info(
            "round %d/%d  %d samples  loss %.4f  %.0f s",
            turn + 1, config.rounds, len(samples), loss, time.monotonic() - started,
        )  # fmt: skip
    return trained(learner, lessons, tracks, config, share, time.monotonic() - started)


def trained(
    learner: Learner, lessons: Lessons, tracks: Sequence[HandTrack], config: TrainConfig, share: float, seconds: float
) -> Trained:
    """What has been learned, ready to be saved."""
    takes = tuple(sorted({track.name.split("/")[0] for track in tracks}))
    return Trained(
        learner.model.eval(), lessons.hand, lessons.rest_angles, lessons.limits, config, takes, share, seconds
    )


def pose_limits(angles: Array) -> Array:
    """Limits `(A, 2)`: the 0.5 and 99.5 percentiles of `angles (N, A)`, widened by seven degrees."""
    low, high = np.percentile(angles, [0.5, 99.5], axis=0)
    return np.stack([low - LIMIT_MARGIN_RAD, high + LIMIT_MARGIN_RAD], axis=1)


def policy_of(model: ManipNet, hand: Hand, limits: Array):
    """The model as a function from features to angles."""
    model.eval()

    def policy(rows: np.ndarray) -> Array:
        with torch.no_grad(), torch.autocast("cpu", torch.bfloat16):
            outputs = model(torch.from_numpy(rows))
        return angles_from_outputs(hand, outputs.double().numpy(), limits)

    return policy


def save_bundle(trained: Trained, folder: Path) -> None:
    """Write `manipnet.onnx`, `hand.npz` and `bundle.json`."""
    folder.mkdir(parents=True, exist_ok=True)
    content = halve_weights(export_onnx(trained.model))
    (folder / "manipnet.onnx").write_bytes(content)
    write_hand(trained.hand, folder / HAND_FILE)
    meta = {
        "format": FORMAT,
        "layout": layout_of(trained.hand).describe(),
        "angle_names": list(trained.hand.angle_names),
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
