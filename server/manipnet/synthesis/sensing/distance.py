"""Signed distance sensors: how far the joints are from the surface, and which way it faces (paper, section 5.3)."""

from manipnet.geometry import Array
from manipnet.jit import inner
from manipnet.synthesis.objects.distance_field import signed_distance
from manipnet.synthesis.objects.shape import Solid
from manipnet.synthesis.sensing.scene import SENSOR_RANGE_M, map_direction_back, map_point


@inner
def sense_distances(
    solid: Solid,
    exact_within_m: float,
    rotation: Array,
    translation: Array,
    scale: float,
    positions: Array,
    distances: Array,
    normals: Array,
):
    """Distances of joint `positions (J, 3)` into `distances (J,)`, clamped at +10 cm, and surface directions into
    `normals (J, 3)` in the wrist frame."""
    for j in range(len(positions)):
        x, y, z = map_point(rotation, translation, scale, positions[j, 0], positions[j, 1], positions[j, 2])
        d, nx, ny, nz = signed_distance(solid.bvh, solid.field, x, y, z, exact_within_m)
        distances[j] = min(d * scale, SENSOR_RANGE_M)
        normals[j, 0], normals[j, 1], normals[j, 2] = map_direction_back(rotation, nx, ny, nz)
