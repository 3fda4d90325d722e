"""Makes the training samples of captured hands, new ones for each round."""

from collections.abc import Sequence

import numpy as np

from manipnet.geometry import Array
from manipnet_tools.training.augment import AnswerRule, captured_samples, on_policy_samples
from manipnet_tools.training.config import TrainConfig
from manipnet_tools.training.dataset import TICK_FRAMES, CapturedHand, Samples, concatenate
from manipnet_tools.training.model import ManipNet, policy_of

LIMIT_MARGIN_RAD = np.radians(7.0)
FUTURE_FRAMES = 60
"""Frames of the future in a window. Samples end this long before the end of a span, so that training sees no frame of a
test."""


class RoundSampler:
    """Makes the samples of each round, and determines the limits and the rest pose of the captured hands."""

    def __init__(self, hands: Sequence[CapturedHand], config: TrainConfig, share: float) -> None:
        """Use the first `share` of every take. All hands must be those of the same subject."""
        self._spans = spans_of(hands, share)
        self._hands, self._config = list(hands), config
        self.hand = hands[0].hand
        """The hand that the network poses."""
        self._rng = np.random.default_rng(config.seed)
        seen = [captured.angles[low:high:4] for captured, (low, high) in zip(hands, self._spans, strict=True)]
        self._pool = np.concatenate(seen)
        self.limits = pose_limits(self._pool)
        """`(A, 2)` radians."""
        self.rest_angles = np.clip(self._pool.mean(axis=0), self.limits[:, 0], self.limits[:, 1])
        """`(A,)` radians."""
        if config.time_reversed:
            self._spans += [
                (len(captured) - high, len(captured) - low)
                for captured, (low, high) in zip(hands, self._spans, strict=True)
            ]
            self._hands += [captured.backwards() for captured in hands]

    def next_round(self, model: ManipNet | None) -> Samples:
        """Samples at captured and blended poses and, given a model, at poses that it reaches itself."""
        config, rng = self._config, self._rng
        lag_ticks = (1.0 - config.response) / config.response
        rule = AnswerRule(config.residual_error, TICK_FRAMES * lag_ticks, config.response)
        parts = []
        for captured, (low, high) in zip(self._hands, self._spans, strict=True):
            for share, pool in ((config.captured, None), (config.blended, self._pool)):
                if share:
                    frames = rng.integers(low, high, int(share * (high - low)))
                    parts.append(captured_samples(captured, frames, pool, rule, self.limits, rng, config.warp))
        if model is not None and config.on_policy:
            parts.append(self._on_policy(model, rule))
        return concatenate(parts)

    def _on_policy(self, model: ManipNet, rule: AnswerRule) -> Samples:
        ticks = self._config.roll_out_ticks
        wanted = self._config.on_policy * np.mean([high - low for low, high in self._spans])
        starts = max(int(wanted / ticks), 1)
        policy = policy_of(model, self.hand, self.limits)
        return on_policy_samples(
            self._hands, self._spans, policy, starts, ticks, rule, self._pool, self.limits, self._rng
        )


def spans_of(hands: Sequence[CapturedHand], share: float) -> list[tuple[int, int]]:
    """First and last frame of each hand that training may use: the first `share` of it, windows included."""
    return [(FUTURE_FRAMES, int(len(captured) * share) - FUTURE_FRAMES) for captured in hands]


def pose_limits(angles: Array) -> Array:
    """Limits `(A, 2)`: the 0.5 and 99.5 percentiles of `angles (N, A)`, widened by seven degrees."""
    low, high = np.percentile(angles, [0.5, 99.5], axis=0)
    return np.stack([low - LIMIT_MARGIN_RAD, high + LIMIT_MARGIN_RAD], axis=1)
