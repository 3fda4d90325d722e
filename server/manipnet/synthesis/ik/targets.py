"""Where the joints should go: the network's positions corrected by its distances (paper, appendix B, algorithm 1)."""

from manipnet.geometry import Array
from manipnet.jit import inner
from manipnet.synthesis.objects.distance_field import signed_distance
from manipnet.synthesis.objects.shape import Solid
from manipnet.synthesis.sensing.scene import map_direction_back, map_point

NEAR_M = 0.028
"""A predicted distance above this leaves the joint where the network put it."""


@inner
def mix_distances(predicted: float, measured: float):
    """Final distance of a joint: mostly the predicted one where the joint is inside the object, else the measured."""
    if measured < 0.0:
        return 0.8 * predicted + 0.2 * measured
    return 0.2 * predicted + 0.8 * measured


@inner
def place_targets(
    solid: Solid,
    rotation: Array,
    translation: Array,
    scale: float,
    positions: Array,
    distances: Array,
    targets: Array,
):
    """Targets `(J, 3)` in the wrist frame from predicted joint `positions (J, 3)` and `distances (J,)`, metres."""
    for j in range(len(positions)):
        for i in range(3):
            targets[j, i] = positions[j, i]
        if distances[j] > NEAR_M:
            continue
        x, y, z = map_point(rotation, translation, scale, positions[j, 0], positions[j, 1], positions[j, 2])
        measured, nx, ny, nz = signed_distance(solid.bvh, solid.field, x, y, z, solid.exact_within_m)
        nx, ny, nz = map_direction_back(rotation, nx, ny, nz)
        step = mix_distances(distances[j], measured * scale) - measured * scale
        targets[j, 0] += step * nx
        targets[j, 1] += step * ny
        targets[j, 2] += step * nz
