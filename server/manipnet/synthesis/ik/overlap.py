"""How deep a finger overlaps the others."""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner
from manipnet.synthesis.hand.hand import CHAIN_LENGTH, Chains


@inner
def _clip(value):
    return min(max(value, 0.0), 1.0)


@inner
def _segment_distance(positions: Array, a, b, c, d):
    """Shortest distance of the segments between joints `a` and `b` and between `c` and `d`.

    Source: Ericson, Real-Time Collision Detection, 5.1.9.
    """
    uu = uv = vv = uw = vw = 0.0
    for i in range(3):
        u, v = positions[b, i] - positions[a, i], positions[d, i] - positions[c, i]
        w = positions[a, i] - positions[c, i]
        uu, uv, vv, uw, vw = uu + u * u, uv + u * v, vv + v * v, uw + u * w, vw + v * w
    s = _clip((uv * vw - uw * vv) / max(uu * vv - uv * uv, 1e-15))
    t = _clip((uv * s + vw) / max(vv, 1e-15))
    s = _clip((uv * t - uw) / max(uu, 1e-15))
    far = 0.0
    for i in range(3):
        u, v = positions[b, i] - positions[a, i], positions[d, i] - positions[c, i]
        far += (positions[a, i] - positions[c, i] + s * u - t * v) ** 2
    return np.sqrt(far)


@inner
def finger_overlap(chains: Chains, finger: int, positions: Array):
    """How deep the capsules of a finger overlap those of other fingers at most, in metres; 0 if they do not."""
    deepest = 0.0
    for other in range(len(chains.angles)):
        if other == finger:
            continue
        for k in range(CHAIN_LENGTH):
            for m in range(CHAIN_LENGTH):
                c, o = chains.capsules[finger, k], chains.capsules[other, m]
                if c >= 0 and o >= 0:
                    one, two = (chains.starts[c], chains.ends[c]), (chains.starts[o], chains.ends[o])
                    apart = _segment_distance(positions, *one, *two)
                    deepest = max(deepest, chains.radii[c] + chains.radii[o] - apart)
    return deepest
