"""Whether synthesised motion can be told from captured motion, by a classifier and by the distance of two clouds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import KDTree
from scipy.special import expit
from scipy.stats import rankdata

from manipnet.geometry import Array
from manipnet_tools.evaluation.metrics import Mask

RIDGE = 1e-2
"""Penalty on the squared weights, relative to the mean loss of a window."""
NEIGHBOURS = 3


@dataclass(frozen=True)
class Standard:
    """Brings columns to mean 0 and standard deviation 1, as they were in the data it was made from."""

    mean: Array
    scale: Array

    @staticmethod
    def of(rows: Array) -> "Standard":
        """The standard of `rows (N, D)`."""
        return Standard(rows.mean(axis=0), np.maximum(rows.std(axis=0), 1e-9))

    def __call__(self, rows: Array) -> Array:
        return np.clip((rows - self.mean) / self.scale, -5.0, 5.0)


def auc(scores: Array, positive: Mask) -> float:
    """Probability that a positive row has a larger score than a negative one; a tie counts half."""
    ranks, count, others = rankdata(scores), positive.sum(), (~positive).sum()
    return float((ranks[positive].sum() - count * (count + 1) / 2) / (count * others))


def fit(rows: Array, positive: Mask) -> Array:
    """Weights `(D + 1,)`, the last a constant, of a logistic regression that weighs both classes alike."""
    inputs = np.concatenate([rows, np.ones((len(rows), 1))], axis=1)
    sign = np.where(positive, 1.0, -1.0)
    share = np.where(positive, 0.5 / positive.sum(), 0.5 / (~positive).sum())

    def loss(weights: Array) -> tuple[float, Array]:
        margin = sign * (inputs @ weights)
        penalty = np.append(weights[:-1], 0.0)
        slope = -(share * sign * expit(-margin)) @ inputs + RIDGE * penalty
        return float(share @ np.logaddexp(0.0, -margin)) + 0.5 * RIDGE * float(penalty @ penalty), slope

    return minimize(loss, np.zeros(inputs.shape[1]), jac=True, method="L-BFGS-B", options={"maxiter": 200}).x


def left_out_auc(negative: Sequence[Array], positive: Sequence[Array]) -> float:
    """Mean AUC over the takes of a classifier that was trained on the other takes, nan for fewer than two takes.

    `negative` and `positive` hold the windows `(N, D)` of each take. Folds inside a take would leak, because its
    windows resemble each other.
    """
    takes = [(a, b) for a, b in zip(negative, positive, strict=True) if len(a) and len(b)]
    if len(takes) < 2:
        return float("nan")
    areas = []
    for k, (a, b) in enumerate(takes):
        others = [take for j, take in enumerate(takes) if j != k]
        rows = np.concatenate([part for take in others for part in take])
        labels = np.concatenate([np.repeat([False, True], [len(x), len(y)]) for x, y in others])
        standard = Standard.of(rows)
        weights = fit(_expanded(standard(rows)), labels)
        tested = _expanded(standard(np.concatenate([a, b])))
        areas.append(auc(tested @ weights[:-1], np.repeat([False, True], [len(a), len(b)])))
    return float(np.mean(areas))


def _expanded(rows: Array) -> Array:
    """The rows and their squares, so that too calm and too lively can both be told."""
    return np.concatenate([rows, rows**2 - 1.0], axis=1)


def frechet_distance(first: Array, second: Array) -> float:
    """Distance of the Gaussians that fit two sets of rows, `(N, D)` each (Heusel et al. 2017)."""
    a, b = np.cov(first.T), np.cov(second.T)
    values, vectors = np.linalg.eigh(a)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    cross = np.sqrt(np.maximum(np.linalg.eigvalsh(root @ b @ root), 0.0)).sum()
    between = first.mean(axis=0) - second.mean(axis=0)
    return float(between @ between + np.trace(a) + np.trace(b) - 2.0 * cross)


def covered(rows: Array, by: Array) -> float:
    """Share of `rows` within the reach of any row of `by`, which is the distance to its third nearest neighbour.

    Of synthesised rows by captured ones this is the precision, the other way round the recall (Kynkäänniemi et al.,
    2019).
    """
    reach = KDTree(by).query(by, NEIGHBOURS + 1)[0][:, -1]
    distance = np.sqrt(np.maximum((rows**2).sum(1)[:, None] + (by**2).sum(1) - 2.0 * rows @ by.T, 0.0))
    return float((distance <= reach).any(axis=1).mean())
