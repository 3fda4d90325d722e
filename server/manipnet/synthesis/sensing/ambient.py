"""Ambient sensor: occupancy of a 10 x 10 x 10 grid in front of the palm (paper, section 5.1)."""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner
from manipnet.synthesis.model.layout import AMBIENT_CELLS
from manipnet.synthesis.objects.distance_field import Field, field_distance
from manipnet.synthesis.sensing.scene import map_direction_back, map_point

CELL_M = 0.018
"""Edge of a cell."""
_STEPS_M = (np.arange(AMBIENT_CELLS) - 0.5 * (AMBIENT_CELLS - 1)) * CELL_M
CELL_OFFSETS_M = np.stack(np.meshgrid(_STEPS_M, _STEPS_M, _STEPS_M, indexing="ij"), axis=-1).reshape(-1, 3)
"""Centre of each cell from the centre of the grid, `(1000, 3)`, in the order of the sensor: x slowest."""

_TO_FIRST_M = 0.5 * (AMBIENT_CELLS - 1) * CELL_M
_HALF_DIAGONAL_M = 0.5 * np.sqrt(3.0) * CELL_M


@inner
def occupancy(distance: float, ox: float, oy: float, oz: float):
    """Occupancy of a cell from its centre's signed distance and the offset to the closest surface point, metres.

    `1 - d / cell` where the cell's box meets the object, 0 elsewhere.
    """
    if distance <= 0.0:
        return 1.0
    if distance > _HALF_DIAGONAL_M or max(abs(ox), abs(oy), abs(oz)) > 0.5 * CELL_M:
        return 0.0
    return 1.0 - distance / CELL_M


@inner
def sense_ambient(field: Field, grid_center: Array, rotation: Array, translation: Array, scale: float, out: np.ndarray):
    """Occupancies of the grid about `grid_center (3,)` into `out (1000,)`, x slowest.

    Blocks of eight cells that are far outside or deep inside are decided by one distance.
    """
    out[:] = 0.0
    first_x, first_y, first_z = grid_center[0] - _TO_FIRST_M, grid_center[1] - _TO_FIRST_M, grid_center[2] - _TO_FIRST_M
    for i in range(0, AMBIENT_CELLS, 2):
        for j in range(0, AMBIENT_CELLS, 2):
            for k in range(0, AMBIENT_CELLS, 2):
                x = first_x + (i + 0.5) * CELL_M
                y = first_y + (j + 0.5) * CELL_M
                z = first_z + (k + 0.5) * CELL_M
                px, py, pz = map_point(rotation, translation, scale, x, y, z)
                block, _, _, _ = field_distance(field, px, py, pz)
                if block * scale > 2.1 * _HALF_DIAGONAL_M:
                    continue
                deep = block * scale < -1.1 * _HALF_DIAGONAL_M
                for cell in range(8):
                    a, b, c = i + (cell >> 2), j + ((cell >> 1) & 1), k + (cell & 1)
                    index = (a * AMBIENT_CELLS + b) * AMBIENT_CELLS + c
                    if deep:
                        out[index] = 1.0
                        continue
                    x, y, z = first_x + a * CELL_M, first_y + b * CELL_M, first_z + c * CELL_M
                    px, py, pz = map_point(rotation, translation, scale, x, y, z)
                    d, gx, gy, gz = field_distance(field, px, py, pz)
                    ox, oy, oz = map_direction_back(rotation, gx, gy, gz)
                    d *= scale
                    out[index] = occupancy(d, d * ox, d * oy, d * oz)
