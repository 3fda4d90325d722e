"""A closed shape with any number of triangles, to measure what triangles cost."""

import numpy as np

from manipnet.synthesis.objects.mesh import ClosedMesh, closed_mesh

HEIGHT_M = 0.11
RADIUS_M = 0.035
FEWEST = 12


def gourd(triangles: int) -> ClosedMesh:
    """A solid of revolution about Y with a waist, as large as a jar, with about `triangles` triangles.

    The surface is always the same; the triangles are on rings of equal size from pole to pole. Raises `ValueError` for
    fewer than 12.
    """
    if triangles < FEWEST:
        raise ValueError(f"{triangles} triangles were requested; at least {FEWEST} are needed")
    sectors = max(round(np.sqrt(triangles / 2.0)), 3)
    rings = round(triangles / (2.0 * sectors)) + 1
    along = np.arange(1, rings) / rings
    radius = RADIUS_M * np.sin(np.pi * along) ** 0.6 * (1.0 - 0.25 * np.exp(-(((along - 0.65) / 0.12) ** 2)))
    turn = 2.0 * np.pi * np.arange(sectors) / sectors
    sides = np.stack(
        np.broadcast_arrays(
            radius[:, None] * np.cos(turn), HEIGHT_M * (along[:, None] - 0.5), -radius[:, None] * np.sin(turn)
        ),
        axis=-1,
    ).reshape(-1, 3)
    bottom, top = len(sides), len(sides) + 1
    vertices = np.concatenate([sides, [[0.0, -0.5 * HEIGHT_M, 0.0], [0.0, 0.5 * HEIGHT_M, 0.0]]])
    here = np.arange(sectors)
    after = (here + 1) % sectors
    last = (rings - 2) * sectors
    faces = [np.stack([np.full(sectors, bottom), after, here], axis=1)]
    for ring in range(rings - 2):
        below, above = ring * sectors, (ring + 1) * sectors
        faces += [
            np.stack([below + here, below + after, above + after], axis=1),
            np.stack([below + here, above + after, above + here], axis=1),
        ]
    faces.append(np.stack([last + here, last + after, np.full(sectors, top)], axis=1))
    return closed_mesh(vertices, np.concatenate(faces), f"gourd-{triangles}")
