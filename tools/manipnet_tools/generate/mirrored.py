"""The mirror image of a shape, on which grasps of the left hand are found as if it were a right one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array, mirror_points
from manipnet.synthesis.objects.shape import Shape
from manipnet_tools.generate.solids import Site

_FLIP: Final = np.array([-1.0, 1.0, 1.0])


class Surface(Protocol):
    """What the search of grasps asks of a shape."""

    @property
    def center_of_mass(self) -> Array:
        """`(3,)` as `Shape.center_of_mass`."""
        ...

    @property
    def inertia(self) -> Array:
        """`(3, 3)` as `Shape.inertia`."""
        ...

    def trace(self, origins: Array, directions: Array) -> Array:
        """Distances to the first hit, as `Shape.trace`."""
        ...

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Distances, normals and closest points, as `Shape.signed_distance`."""
        ...


@dataclass(frozen=True, eq=False)
class Mirrored:
    """A shape seen in a mirror, x to -x."""

    shape: Shape

    @property
    def center_of_mass(self) -> Array:
        """`(3,)`"""
        return mirror_points(self.shape.center_of_mass)

    @property
    def inertia(self) -> Array:
        """`(3, 3)`"""
        return self.shape.inertia * np.outer(_FLIP, _FLIP)

    def trace(self, origins: Array, directions: Array) -> Array:
        """As `Shape.trace`."""
        return self.shape.trace(mirror_points(origins), mirror_points(directions))

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """As `Shape.signed_distance`."""
        distance, normal, closest = self.shape.signed_distance(mirror_points(points))
        return distance, mirror_points(normal), mirror_points(closest)


def mirrored_corners(corners: NDArray) -> NDArray:
    """Triangles `(F, 3, 3)` seen in a mirror, still counter-clockwise from outside."""
    return mirror_points(corners)[:, ::-1]


def mirrored_sites(sites: Sequence[Site]) -> tuple[Site, ...]:
    """Places to hold, seen in a mirror."""
    return tuple(
        Site(s.kind, mirror_points(s.point), mirror_points(s.along), mirror_points(s.out), s.radius) for s in sites
    )
