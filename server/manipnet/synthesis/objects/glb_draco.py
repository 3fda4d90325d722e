"""Decompresses meshes of glTF files that are compressed with Draco, if its library is installed."""

import importlib.util
from typing import Final

import numpy as np
from numpy.typing import NDArray

from manipnet.synthesis.objects.glb_accessors import GlbError

DRACO: Final = "KHR_draco_mesh_compression"


def decode_draco(data: bytes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices `(V, 3)` and triangles `(F, 3)`. Raises `GlbError`."""
    if importlib.util.find_spec("DracoPy") is None:
        raise GlbError(
            f"is compressed with {DRACO}, for which a library is missing; export it without compression, "
            "or install the library: python -m pip install DracoPy"
        )
    import DracoPy  # pyright: ignore[reportMissingImports]

    try:
        mesh = DracoPy.decode(data)
    except Exception as error:  # the library raises exceptions of any kind
        raise GlbError(
            f"is compressed with {DRACO}, but cannot be decompressed ({error}); export it without compression"
        ) from None
    return np.asarray(mesh.points, np.float64).reshape(-1, 3), np.asarray(mesh.faces, np.int64).reshape(-1, 3)
