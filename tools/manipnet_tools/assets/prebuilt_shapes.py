"""Read the meshes of the library and build the shapes of the demo's objects in advance.

Run `python -m manipnet_tools.assets.prebuilt_shapes` after a change of the objects or of the code that builds shapes.
"""

import tempfile
from pathlib import Path

import numpy as np

from manipnet.demo.player import DEMO_OBJECTS
from manipnet.synthesis.objects.library import LIBRARY_FOLDER, library_names, load_library_mesh
from manipnet.synthesis.objects.mesh_cache import mesh_cache_name, write_cached_mesh
from manipnet.synthesis.objects.shape import PREBUILT_FOLDER, build_shape


def main() -> None:
    """Replace the meshes and shapes in the package."""
    PREBUILT_FOLDER.mkdir(exist_ok=True)
    for old in PREBUILT_FOLDER.glob("*.npz"):
        old.unlink()
    with tempfile.TemporaryDirectory() as made:
        for name in library_names():
            mesh = load_library_mesh(name)
            write_cached_mesh(Path(made) / str(mesh_cache_name(LIBRARY_FOLDER / f"{name}.ply", "m", 1.0)), mesh)
            if name in DEMO_OBJECTS:
                build_shape(mesh, Path(made))
        for file in sorted(Path(made).iterdir()):
            path = PREBUILT_FOLDER / file.name
            with np.load(file, allow_pickle=False) as arrays:
                np.savez_compressed(path, allow_pickle=False, **arrays)
            print(f"{path}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
