"""The weights of frames that show an instant between them.

They are those of a uniform cubic B-spline over the frames. Its acceleration is the linear interpolation of the frames'
second differences, so it never exceeds theirs at any display rate. A lost frame is replaced by the cubic through two
neighbours on each side.
"""

from __future__ import annotations

from collections.abc import Collection


def spline_weights(position: float, present: Collection[int]) -> dict[int, float]:
    """The weight of each frame for the instant `position`, by its index; the weights sum to one.

    `present` holds the indices on a uniform grid of the frames that arrived, at least one. A position before the first
    or after the last frame shows that frame.
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
    """The weights of frames that give the grid point `index`.

    A lost frame is interpolated; beyond the ends the first or last two points are continued in a straight line.
    """
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
    """The weights with which the polynomial through `nodes` is evaluated at `index`."""
    weights = {}
    for node in nodes:
        weight = 1.0
        for other in nodes:
            if other != node:
                weight *= (index - other) / (node - other)
        weights[node] = weight
    return weights
