"""Build the shapes of the demo's objects in advance.

Run `python -m manipnet_tools.assets.prebuilt_shapes` after a change of the objects or of the code that builds shapes.
"""

import tempfile
from pathlib import Path

import numpy as np

from manipnet.demo.player import DEMO_OBJECTS
from manipnet.synthesis.objects.library import load_library_mesh
from manipnet.synthesis.objects.shape import PREBUILT_FOLDER, build_shape, cache_name


def main() -> None:
    """Replace the shapes in the package."""
    PREBUILT_FOLDER.mkdir(exist_ok=True)
    for old in PREBUILT_FOLDER.glob("*.npz"):
        old.unlink()
    for name in DEMO_OBJECTS:
        mesh = load_library_mesh(name)
        with tempfile.TemporaryDirectory() as folder:
            shape = build_shape(mesh, Path(folder))
        path = PREBUILT_FOLDER / cache_name(mesh)
        np.savez_compressed(path, allow_pickle=False, **shape.bvh._asdict(), **shape.field._asdict())
        print(f"{path}: {name}, {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
