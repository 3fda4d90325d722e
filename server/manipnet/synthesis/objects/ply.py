"""Triangle meshes as PLY files (https://paulbourke.net/dataformats/ply/), without a library that reads all formats."""

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array

_FACE = np.dtype([("corners", "u1"), ("vertices", "<i4", 3)])


def ply_file(vertices: Array, faces: NDArray[np.integer]) -> bytes:
    """A binary PLY file of `vertices (V, 3)`, in double precision, and triangles `faces (F, 3)`."""
    header = "\n".join(
        [
            *("ply", "format binary_little_endian 1.0"),
            f"element vertex {len(vertices)}",
            *(f"property double {axis}" for axis in "xyz"),
            f"element face {len(faces)}",
            *("property list uchar int vertex_indices", "end_header", ""),
        ]
    )
    rows = np.empty(len(faces), _FACE)
    rows["corners"], rows["vertices"] = 3, faces
    return header.encode("ascii") + vertices.astype("<f8").tobytes() + rows.tobytes()
