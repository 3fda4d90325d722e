"""Which frames to mix, and how much of each, to show an instant between them.

A uniform cubic B-spline over the frames: its acceleration is the linear interpolation of the frames' own
second differences, so at any display rate it never exceeds theirs. Lost frames are filled from two neighbours
on each side.
"""

from __future__ import annotations

from collections.abc import Collection


def spline_weights(position: float, present: Collection[int]) -> dict[int, float]:
    """Weight of each frame of `present` (indices on a uniform grid, at least one) for the instant `position`.

    Positions before the first or after the last frame show that frame. The weights sum to one.
    """
    first, last = min(present), max(present)
    if first == last:
        return {first: 1.0}
    position = min(max(position, first), last)
    start = min(int(position // 1.0), last - 1)
    f = position - start
    basis = (
        (1 - f) ** 3 / 6,
        (3 * f**3 - 6 * f**2 + 4) / 6,
        (-3 * f**3 + 3 * f**2 + 3 * f + 1) / 6,
        f**3 / 6,
    )
    weights: dict[int, float] = {}
    for offset, weight in enumerate(basis):
        for index, part in _control(start - 1 + offset, first, last, present).items():
            weights[index] = weights.get(index, 0.0) + weight * part
    return weights


def _control(index: int, first: int, last: int, present: Collection[int]) -> dict[int, float]:
    """A grid point as a mix of frames: itself, filled if lost, continued straight beyond the ends."""
    if index in present:
        return {index: 1.0}
    if index > last:
        return _straight_on(last, last - 1, first, last, present)
    if index < first:
        return _straight_on(first, first + 1, first, last, present)
    before = [i for i in range(index - 1, first - 1, -1) if i in present][:2]
    after = [i for i in range(index + 1, last + 1) if i in present][:2]
    return _lagrange(index, before + after)


def _straight_on(end: int, inner: int, first: int, last: int, present: Collection[int]) -> dict[int, float]:
    mix = {i: -part for i, part in _control(inner, first, last, present).items()}
    mix[end] = mix.get(end, 0.0) + 2.0
    return mix


def _lagrange(index: int, nodes: list[int]) -> dict[int, float]:
    """Weights of the polynomial through `nodes`, at `index`."""
    weights = {}
    for node in nodes:
        weight = 1.0
        for other in nodes:
            if other != node:
                weight *= (index - other) / (node - other)
        weights[node] = weight
    return weights
