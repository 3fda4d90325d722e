"""Where the capsules of a hand touch an object, and the forces that they can supply there."""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, vector
from manipnet.synthesis.hand.hand import Chains
from manipnet.synthesis.ik.chains import Surface, capsule_sample
from manipnet.synthesis.objects.distance_field import signed_distance
from manipnet.synthesis.objects.shape import Solid
from manipnet.synthesis.sensing.scene import map_point

FRICTION = 0.35
"""As in the paper's appendix A."""
LEVER_M = 0.05
"""Torques are divided by this, so that they weigh like forces."""
TOUCH_M = 0.003
"""A capsule with a smaller gap pushes."""
EDGES = 4
"""Edges of the friction cone."""
CONTACT = 7
"""Numbers of a contact: the gap in metres, the closest point of the surface, its outward normal."""
_EXACT_BELOW_M = 0.010
_SAMPLES = 7
_PALM_START = 0.3
"""A palm capsule starts at the wrist, where the palm has no skin; this share of it is left out."""


@inner
def find_contact(chains: Chains, capsule: int, positions: Array, surface: Surface, solid: Solid, out: Array):
    """The contact of one capsule with the object, into `out (7,)`, in the object's own metres except for the gap.

    The point and the normal are written only if the gap is below a centimetre.
    """
    least, at, point = np.inf, 0.0, vector()
    first = _PALM_START if chains.starts[capsule] == 0 else 0.0
    for s in range(_SAMPLES):
        fraction = first + (1.0 - first) * s / (_SAMPLES - 1.0)
        distance = capsule_sample(chains, capsule, fraction, positions, surface)[3]
        if distance < least:
            least, at = distance, fraction
    out[0] = least - chains.radii[capsule]
    if out[0] > _EXACT_BELOW_M:
        return
    start, end = chains.starts[capsule], chains.ends[capsule]
    for i in range(3):
        point[i] = positions[start, i] + at * (positions[end, i] - positions[start, i])
    x, y, z = map_point(surface.rotation, surface.translation, surface.scale, point[0], point[1], point[2])
    distance, nx, ny, nz = signed_distance(solid.bvh, solid.field, x, y, z, np.inf)
    out[0] = distance * surface.scale - chains.radii[capsule]
    out[1], out[2], out[3] = x - distance * nx, y - distance * ny, z - distance * nz
    out[4], out[5], out[6] = nx, ny, nz


@inner
def _tangent(nx: float, ny: float, nz: float):
    """A unit vector across a unit normal."""
    ax, ay, az = abs(nx), abs(ny), abs(nz)
    if ax <= ay and ax <= az:
        x, y, z = 0.0, nz, -ny
    elif ay <= az:
        x, y, z = -nz, 0.0, nx
    else:
        x, y, z = ny, -nx, 0.0
    size = 1.0 / max(np.sqrt(x * x + y * y + z * z), 1e-9)
    return x * size, y * size, z * size


@inner
def add_wrenches(contact: Array, center: Array, scale: float, columns: Array, count: int):
    """Append the edges of a contact's friction cone to the first `count` of `columns (N, 6)`; returns their new number.

    Forces push into the object; torques are about its centre of mass `center (3,)`, divided by `LEVER_M`.
    """
    nx, ny, nz = contact[4], contact[5], contact[6]
    tx, ty, tz = _tangent(nx, ny, nz)
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    arm = scale / LEVER_M
    px, py, pz = (contact[1] - center[0]) * arm, (contact[2] - center[1]) * arm, (contact[3] - center[2]) * arm
    for edge in range(EDGES):
        aside = FRICTION if edge % 2 == 0 else -FRICTION
        ux, uy, uz = (tx, ty, tz) if edge < 2 else (bx, by, bz)
        fx, fy, fz = aside * ux - nx, aside * uy - ny, aside * uz - nz
        column = columns[count + edge]
        column[0], column[1], column[2] = fx, fy, fz
        column[3], column[4], column[5] = py * fz - pz * fy, pz * fx - px * fz, px * fy - py * fx
    return count + EDGES
