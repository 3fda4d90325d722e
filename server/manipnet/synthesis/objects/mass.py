"""Mass properties of a closed mesh of uniform density."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array


class Mass(NamedTuple):
    """Where the mass of an object is, in its own frame."""

    center_of_mass: Array
    """`(3,)` metres."""
    volume_m3: float
    inertia: Array
    """`(3, 3)` about the centre of mass for a total mass of 1 kg."""


def mass_of(vertices: Array, faces: NDArray[np.int32]) -> Mass:
    """The mass properties of a closed mesh with outward `faces (F, 3)`.

    The sum over the tetrahedra between the triangles and a point, of which those that face the point count negative
    (Tonon 2004, "Explicit Exact Formulas for the 3-D Tetrahedron Inertia Tensor in Terms of its Vertex Coordinates").
    """
    origin = vertices.mean(axis=0)  # far from it, differences of large numbers would lose digits
    corners = vertices[faces] - origin
    volumes = np.linalg.det(corners) / 6.0
    volume = volumes.sum()
    sums = corners.sum(axis=1)
    center = volumes @ sums / (4.0 * volume)
    squares = np.einsum("f,fki,fkj->ij", volumes, corners, corners) + np.einsum("f,fi,fj->ij", volumes, sums, sums)
    second = squares / (20.0 * volume) - np.outer(center, center)
    return Mass(origin + center, float(volume), np.trace(second) * np.eye(3) - second)
