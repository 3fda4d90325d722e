"""Signed distance sensors: how far the joints are from the surface, and which way it faces (paper, section 5.3)."""

from manipnet.jit import inner
from manipnet.synthesis.hand.skeleton import JOINT_COUNT
from manipnet.synthesis.objects.distance_field import signed_distance
from manipnet.synthesis.sensing.scene import SENSOR_RANGE_M, map_direction_back, map_point


@inner
def sense_distances(solid, exact_within_m, rotation, translation, scale, positions, distances, normals):
    """Distances of joint `positions (22, 3)` into `distances (22,)`, clamped at +10 cm, and surface directions into
    `normals (22, 3)` in the wrist frame."""
    for j in range(JOINT_COUNT):
        x, y, z = map_point(rotation, translation, scale, positions[j, 0], positions[j, 1], positions[j, 2])
        d, nx, ny, nz = signed_distance(solid.bvh, solid.field, x, y, z, exact_within_m)
        distances[j] = min(d * scale, SENSOR_RANGE_M)
        normals[j, 0], normals[j, 1], normals[j, 2] = map_direction_back(rotation, nx, ny, nz)
