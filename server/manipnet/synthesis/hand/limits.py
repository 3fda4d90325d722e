"""Angles kept where fingers can be."""

from manipnet.jit import kernel


@kernel
def keep_angles(angles, limits, last, reach, kept):
    """`angles (20,)` inside `limits (20, 2)` and within `reach` of the `last (20,)`, into `kept (20,)`.

    Returns whether the limits and whether the reach made a difference.
    """
    beyond_limits, too_far = False, False
    for i in range(len(angles)):
        inside = min(max(angles[i], limits[i, 0]), limits[i, 1])
        kept[i] = min(max(inside, last[i] - reach), last[i] + reach)
        beyond_limits = beyond_limits or abs(inside - angles[i]) > 1e-6
        too_far = too_far or abs(kept[i] - inside) > 1e-6
    return beyond_limits, too_far
