"""Angles kept inside their limits and within reach of the last ones."""

from manipnet.geometry import Array
from manipnet.jit import kernel


@kernel
def keep_angles(angles: Array, limits: Array, last: Array, reach: float, kept: Array):
    """`angles (A,)` inside `limits (A, 2)` and within `reach` of the `last (A,)`, into `kept (A,)`.

    Returns whether the limits made a difference, and whether the reach did.
    """
    beyond_limits, too_far = False, False
    for i in range(len(angles)):
        inside = min(max(angles[i], limits[i, 0]), limits[i, 1])
        kept[i] = min(max(inside, last[i] - reach), last[i] + reach)
        beyond_limits = beyond_limits or abs(inside - angles[i]) > 1e-6
        too_far = too_far or abs(kept[i] - inside) > 1e-6
    return beyond_limits, too_far
