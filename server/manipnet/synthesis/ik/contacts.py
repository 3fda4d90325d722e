"""Where the capsules of a hand touch an object, and the forces that they can supply there."""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, stack_array, vector
from manipnet.synthesis.hand.hand import Chains
from manipnet.synthesis.ik.chains import Surface, capsule_sample
from manipnet.synthesis.ik.nnls import SIZE
from manipnet.synthesis.objects.shape import Solid
from manipnet.synthesis.objects.distance_field import signed_distance

FRICTION = 0.35
LEVER_M = 0.05
"""Torques are divided by this, so that they weigh like forces."""
TOUCH_M = 0.003
"""A capsule with a smaller gap pushes."""
LOOK_M = 0.010
"""Gaps below this are computed exactly."""
EDGES = 4
"""Edges of the friction cone."""
SAMPLES = 7
PALM_START = 0.3
"""The palm's capsules begin at the wrist, where there is no skin to touch with."""
_contact = stack_array(8)


@inner
def capsule_contact(
    chains: Chains, capsule: int, positions: Array, surface: Surface, solid: Solid, out: Array
):
    """The contact of one capsule, into `out (7,)`: gap in metres, closest surface point and its normal, in the object's
    own metres."""
    least, at = np.inf, 0.0
    first = PALM_START if chains.starts[capsule] == 0 else 0.0
    for s in range(SAMPLES):
        f = first + (1.0 - first) * s / (SAMPLES - 1.0)
        distance = capsule_sample(chains, capsule, f, positions, surface)[3]
        if distance < least:
            least, at = distance, f
    out[0] = least - chains.radii[capsule]
    if out[0] > LOOK_M:
        return
    start, end, scale = chains.starts[capsule], chains.ends[capsule], surface.scale
    p = vector()
    for i in range(3):
        p[i] = positions[start, i] + at * (positions[end, i] - positions[start, i])
    r, t = surface.rotation, surface.translation
    q = vector()
    for i in range(3):
        q[i] = (r[i, 0] * p[0] + r[i, 1] * p[1] + r[i, 2] * p[2] + t[i]) / scale
    d, nx, ny, nz = signed_distance(solid.bvh, solid.field, q[0], q[1], q[2], np.inf)
    out[0] = d * scale - chains.radii[capsule]
    out[1], out[2], out[3] = q[0] - d * nx, q[1] - d * ny, q[2] - d * nz
    out[4], out[5], out[6] = nx, ny, nz


@inner
def add_wrenches(contact: Array, center: Array, scale: float, columns: Array, count: int):
    """Add the edges of the friction cone of a `contact (7,)` to `columns (N, 6)`; returns their new number.

    Forces push into the object, with torques about its centre of mass `center (3,)`.
    """
    nx, ny, nz = contact[4], contact[5], contact[6]
    ax, ay, az = abs(nx), abs(ny), abs(nz)
    if ax <= ay and ax <= az:
        tx, ty, tz = 0.0, nz, -ny
    elif ay <= az:
        tx, ty, tz = -nz, 0.0, nx
    else:
        tx, ty, tz = ny, -nx, 0.0
    size = 1.0 / max(np.sqrt(tx * tx + ty * ty + tz * tz), 1e-9)
    tx, ty, tz = tx * size, ty * size, tz * size
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    arm = scale / LEVER_M
    px, py, pz = (contact[1] - center[0]) * arm, (contact[2] - center[1]) * arm, (contact[3] - center[2]) * arm
    for edge in range(EDGES):
        sign = FRICTION if edge % 2 == 0 else -FRICTION
        ux, uy, uz = (tx, ty, tz) if edge < 2 else (bx, by, bz)
        fx, fy, fz = sign * ux - nx, sign * uy - ny, sign * uz - nz
        column = columns[count + edge]
        column[0], column[1], column[2] = fx, fy, fz
        column[3], column[4], column[5] = py * fz - pz * fy, pz * fx - px * fz, px * fy - py * fx
    return count + EDGES
