"""`manipnet train`: trains a model on captured or generated takes, and writes a bundle."""

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import cast

import numpy as np
import torch

from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.model.layout import layout_of
from manipnet_tools.terminal import open_console
from manipnet_tools.training.config import TrainConfig
from manipnet_tools.training.dataset import Samples, TakeSet, load_captured_hands
from manipnet_tools.training.model import ManipNet, normalisation
from manipnet_tools.training.options import TrainOptions
from manipnet_tools.training.sampler import RoundSampler
from manipnet_tools.training.start import Start, read_start
from manipnet_tools.training.trained import Trained, save_bundle

_log = logging.getLogger(__name__)


class Trainer:
    """Trains one model, round by round, at a falling learning rate."""

    def __init__(self, model: ManipNet, config: TrainConfig) -> None:
        """Go on from the weights of `model`."""
        self._config = config
        self._rng = np.random.default_rng(config.seed)
        self._last = model
        self._average = torch.optim.swa_utils.AveragedModel(
            self._last, multi_avg_fn=torch.optim.swa_utils.get_ema_multi_avg_fn(config.weight_average)
        )
        self._optimizer = torch.optim.AdamW(
            self._last.parameters(), config.learning_rate, weight_decay=config.weight_decay, fused=True
        )
        total = config.rounds * config.epochs_per_round
        self._schedule = torch.optim.lr_scheduler.CosineAnnealingLR(self._optimizer, total, config.learning_rate / 50)

    @property
    def model(self) -> ManipNet:
        """The model as it would be shipped now."""
        return cast(ManipNet, self._average.module) if self._config.weight_average else self._last

    def learn(self, samples: Samples) -> float:
        """Learn the epochs of one round; returns the loss of the last epoch."""
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


def new_model(hand: Hand, first: Samples, config: TrainConfig) -> ManipNet:
    """A model with random weights; its normalisation is taken from the `first` samples."""
    layout = layout_of(hand)
    norm = normalisation(layout, first.inputs, first.outputs, config.predict_change)
    return ManipNet(layout, norm, config.width, config.dropout, config.architecture, config.hidden)


def train(
    sets: Sequence[TakeSet],
    config: TrainConfig,
    share: float = 1.0,
    start: Start | None = None,
    after_round: Callable[[Trained, str], None] = lambda trained, text: _log.info(text),
) -> Trained:
    """Train on the first `share` of each take, from the weights of `start` or from random ones.

    The same seed gives the same result. Training uses one thread, because with the small batches that train best, a
    second thread mostly waits. `after_round` receives the model as it is after each round, and a line about it.
    """
    started = time.monotonic()
    torch.set_num_threads(1)
    torch.manual_seed(config.seed)
    sampler = RoundSampler(sets, config, share, None if start is None else start.posed)
    samples = sampler.next_round(None if start is None else start.network)
    trainer = Trainer(new_model(sampler.hand, samples, config) if start is None else start.network, config)
    for turn in range(config.rounds):
        if turn:
            samples = sampler.next_round(trainer.model)
        loss = trainer.learn(samples)
        elapsed_s = time.monotonic() - started
        text = f"round {turn + 1}/{config.rounds}  {len(samples)} samples  loss {loss:.4f}  {elapsed_s:.0f} s"
        after_round(trained(trainer, sampler, sets, config, share, elapsed_s), text)
    return trained(trainer, sampler, sets, config, share, time.monotonic() - started)


def trained(
    trainer: Trainer,
    sampler: RoundSampler,
    sets: Sequence[TakeSet],
    config: TrainConfig,
    share: float,
    seconds: float,
) -> Trained:
    """The model as it is now, with everything else that a bundle needs."""
    takes = tuple(sorted({captured.name.split("/")[0] for each in sets for captured in each.hands}))
    model, rest_angles, limits = trainer.model.eval(), sampler.rest_angles, sampler.limits
    return Trained(model, sampler.hand, rest_angles, limits, config, takes, share, seconds)


def run(options: TrainOptions) -> None:
    """Train and write the bundle. Raises `BundleError`, `DataError`, `TakeError` and `MeshError`."""
    config, start = options.training, None
    if options.start is not None:
        start, config = read_start(options.start, config)
    sets = [TakeSet(load_captured_hands(each.path, each.takes), each.weight) for each in options.folders()]
    licence, console = options.licence(), open_console()

    def keep(now: Trained, text: str) -> None:
        save_bundle(replace(now, licence=licence, started_from=start and start.bundle_hash), options.out)
        console.print(text)

    train(sets, config, options.share, start, keep)
