"""Makes the training samples of captured hands, new ones for each round."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet_tools.takes.bone_frames import in_frames_of
from manipnet_tools.takes.dataset import DataError
from manipnet_tools.training.augment import AnswerRule, captured_samples, on_policy_samples
from manipnet_tools.training.config import TrainConfig
from manipnet_tools.training.dataset import CAPTURE_HZ, TICK_FRAMES, CapturedHand, Samples, TakeSet, concatenate
from manipnet_tools.training.model import ManipNet, policy_of

LIMIT_MARGIN_RAD = np.radians(7.0)
FUTURE_FRAMES = 60
"""Frames of the future in a window. Samples end this long before the end of a span, so that training sees no frame of a
test."""
LEAST_STARTS = 8
"""Roll-outs of one hand at the same time; with fewer, a tick costs as much and gives less."""


@dataclass(frozen=True, eq=False)
class Posed:
    """A hand with its mean pose, by which hands that rest differently are compared."""

    hand: Hand
    angles: Array
    """`(A,)`"""


@dataclass(frozen=True, eq=False)
class _Part:
    """One set of takes, prepared for sampling. Its poses are blended among themselves only, because the angles of two
    kinds of hands need not mean the same pose."""

    hands: list[CapturedHand]
    spans: list[tuple[int, int]]
    pool: Array
    """`(N, A)` captured poses."""
    limits: Array
    """`(A, 2)` radians."""
    thinned: float
    """Share of the recipe's samples per frame that a round takes."""


class RoundSampler:
    """Makes the samples of each round, and determines the limits and the rest pose of the captured hands."""

    def __init__(self, sets: Sequence[TakeSet], config: TrainConfig, share: float, model: Posed | None = None) -> None:
        """Use the first `share` of every take. Raises `DataError` if a set has no take that is long enough.

        The network knows one layout of the bones' frames: that of `model`, or else that of the first set's main hand.
        """
        self._config = config
        self._rng = np.random.default_rng(config.seed)
        sets = [_long_enough(each, share) for each in sets]
        pools = [_pool(each.hands, share) for each in sets]
        rests = [pool.mean(axis=0) for pool in pools]
        own = main_hand(sets[0])
        model = Posed(own, rests[0]) if model is None else model
        self.hand = in_frames_of(own, model.hand, rests[0], model.angles)
        """The hand that the network poses: the one that most takes of the first set have."""
        self._parts = [
            self._prepared(_in_frames(each.hands, rest, model), share, pool, thinned)
            for each, rest, pool, thinned in zip(sets, rests, pools, _thinned(sets, config, share), strict=True)
        ]
        self.limits = self._parts[0].limits
        """`(A, 2)` radians."""
        self.rest_angles = np.clip(rests[0], self.limits[:, 0], self.limits[:, 1])
        """`(A,)` radians."""

    def _prepared(self, hands: list[CapturedHand], share: float, pool: Array, thinned: float) -> _Part:
        spans = spans_of(hands, share)
        if self._config.time_reversed:
            backward = [(len(c) - high, len(c) - low) for c, (low, high) in zip(hands, spans, strict=True)]
            hands, spans = hands + [captured.backwards() for captured in hands], spans + backward
        return _Part(hands, spans, pool, pose_limits(pool), thinned)

    def next_round(self, model: ManipNet | None) -> Samples:
        """Samples at captured and blended poses and, given a model, at poses that it reaches itself."""
        config = self._config
        lag_ticks = (1.0 - config.response) / config.response
        rule = AnswerRule(config.residual_error, TICK_FRAMES * lag_ticks, config.response)
        samples: list[Samples] = []
        for part in self._parts:
            samples += self._around_captured(part, rule)
            if model is not None and config.on_policy:
                samples += self._on_policy(part, model, rule)
        return concatenate(samples)

    def _around_captured(self, part: _Part, rule: AnswerRule) -> list[Samples]:
        config, rng, samples = self._config, self._rng, []
        for captured, (low, high) in zip(part.hands, part.spans, strict=True):
            for share, pool in ((config.captured, None), (config.blended, part.pool)):
                if count := int(share * part.thinned * (high - low)):
                    frames = rng.integers(low, high, count)
                    samples.append(
                        captured_samples(captured, frames, pool, rule, part.limits, rng, config.warp, config.sliding)
                    )
        return samples

    def _on_policy(self, part: _Part, model: ManipNet, rule: AnswerRule) -> list[Samples]:
        ticks, sliding, rng = self._config.roll_out_ticks, self._config.sliding, self._rng
        wanted = self._config.on_policy * part.thinned * sum(high - low for low, high in part.spans) / ticks
        rolled = np.flatnonzero([high - low > TICK_FRAMES * ticks for low, high in part.spans])
        if not len(rolled):
            return []
        if wanted < LEAST_STARTS * len(rolled):
            rolled = rng.choice(rolled, max(int(wanted / LEAST_STARTS), 1), replace=False)
        hands, spans = [part.hands[k] for k in rolled], [part.spans[k] for k in rolled]
        starts = [max(int(wanted / len(rolled)), 1)] * len(rolled)
        policy = policy_of(model)
        return [on_policy_samples(hands, spans, policy, starts, ticks, rule, part.pool, part.limits, rng, sliding)]


def _long_enough(takes: TakeSet, share: float) -> TakeSet:
    """The set without takes that are too short for a window. Raises `DataError` if none is left."""
    left = [c for c, (low, high) in zip(takes.hands, spans_of(takes.hands, share), strict=True) if high > low]
    if not left:
        least_s = (2 * FUTURE_FRAMES + 1) / CAPTURE_HZ / share
        names = takes.hands[0].name.partition("/")[0] if takes.hands else "no take"
        raise DataError(f"{names}, …: no take is long enough to train on; one must have at least {least_s:.2f} s")
    return replace(takes, hands=left)


def main_hand(takes: TakeSet) -> Hand:
    """The hand that most takes of a set have."""
    (name, _), *_ = Counter(captured.hand.name for captured in takes.hands).most_common()
    return next(captured.hand for captured in takes.hands if captured.hand.name == name)


def _pool(hands: Sequence[CapturedHand], share: float) -> Array:
    """Captured poses `(N, A)` of takes."""
    return np.concatenate([c.angles[low:high:4] for c, (low, high) in zip(hands, spans_of(hands, share), strict=True)])


def _in_frames(hands: Sequence[CapturedHand], rest: Array, model: Posed) -> list[CapturedHand]:
    """The same takes with the bones' frames that the model knows; `rest (A,)` is the takes' mean pose."""
    turned: dict[bytes, Hand] = {}
    for captured in hands:
        if (key := captured.hand.packed.tobytes()) not in turned:
            turned[key] = in_frames_of(captured.hand, model.hand, rest, model.angles)
    return [replace(captured, hand=turned[captured.hand.packed.tobytes()]) for captured in hands]


def _thinned(sets: Sequence[TakeSet], config: TrainConfig, share: float) -> list[float]:
    """For each set the share of the recipe's samples per frame with which a round has the size that it may have."""
    frames = np.array([sum(high - low for low, high in spans_of(each.hands, share)) for each in sets])
    weights = np.array([each.weight for each in sets])
    per_frame = config.captured + config.blended + config.on_policy
    whole = min(config.round_samples, per_frame * frames.sum())
    return list(whole * weights / weights.sum() / (per_frame * frames))


def spans_of(hands: Sequence[CapturedHand], share: float) -> list[tuple[int, int]]:
    """First and last frame of each hand that training may use: the first `share` of it, windows included."""
    return [(FUTURE_FRAMES, int(len(captured) * share) - FUTURE_FRAMES) for captured in hands]


def pose_limits(angles: Array) -> Array:
    """Limits `(A, 2)`: the 0.5 and 99.5 percentiles of `angles (N, A)`, widened by seven degrees."""
    low, high = np.percentile(angles, [0.5, 99.5], axis=0)
    return np.stack([low - LIMIT_MARGIN_RAD, high + LIMIT_MARGIN_RAD], axis=1)
