"""Ambient sensor: occupancy of a 10 x 10 x 10 grid in front of the palm (paper, section 5.1)."""

import numpy as np

from manipnet.jit import inner
from manipnet.synthesis.hand.skeleton import JOINT_NAMES, OFFSETS_M
from manipnet.synthesis.objects.distance_field import field_distance
from manipnet.synthesis.sensing.scene import map_direction_back, map_point

CELLS = 10
CELL_M = 0.018
CENTER_M = OFFSETS_M[JOINT_NAMES.index("MIDDLE_MCP")] + np.array([0.04, 0.0, -0.09])
"""Centre of the grid in the wrist frame; the bone to the middle finger's root is rigid, so it never moves."""

_FIRST = CENTER_M - 0.5 * (CELLS - 1) * CELL_M
_HALF_DIAGONAL_M = 0.5 * np.sqrt(3.0) * CELL_M


@inner
def occupancy(distance, ox, oy, oz):
    """Occupancy of a cell from its centre's signed distance and the offset to the closest surface point, metres.

    `1 - d / cell` where the cell's box meets the object, 0 elsewhere.
    """
    if distance <= 0.0:
        return 1.0
    if distance > _HALF_DIAGONAL_M or max(abs(ox), abs(oy), abs(oz)) > 0.5 * CELL_M:
        return 0.0
    return 1.0 - distance / CELL_M


@inner
def sense_ambient(field, rotation, translation, scale, out):
    """Occupancies into `out (1000,)`, x slowest. Blocks of eight cells far outside or deep inside go at once."""
    out[:] = 0.0
    for i in range(0, CELLS, 2):
        for j in range(0, CELLS, 2):
            for k in range(0, CELLS, 2):
                x = _FIRST[0] + (i + 0.5) * CELL_M
                y = _FIRST[1] + (j + 0.5) * CELL_M
                z = _FIRST[2] + (k + 0.5) * CELL_M
                px, py, pz = map_point(rotation, translation, scale, x, y, z)
                block, _, _, _ = field_distance(field, px, py, pz)
                if block * scale > 2.1 * _HALF_DIAGONAL_M:
                    continue
                deep = block * scale < -1.1 * _HALF_DIAGONAL_M
                for cell in range(8):
                    a, b, c = i + (cell >> 2), j + ((cell >> 1) & 1), k + (cell & 1)
                    index = (a * CELLS + b) * CELLS + c
                    if deep:
                        out[index] = 1.0
                        continue
                    x, y, z = _FIRST[0] + a * CELL_M, _FIRST[1] + b * CELL_M, _FIRST[2] + c * CELL_M
                    px, py, pz = map_point(rotation, translation, scale, x, y, z)
                    d, gx, gy, gz = field_distance(field, px, py, pz)
                    ox, oy, oz = map_direction_back(rotation, gx, gy, gz)
                    d *= scale
                    out[index] = occupancy(d, d * ox, d * oy, d * oz)
