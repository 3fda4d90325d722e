"""The objects that come with the server: generated shapes in metres, Y up, by name."""

from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from manipnet.synthesis.objects.mesh import ClosedMesh

LIBRARY_FOLDER: Final = Path(__file__).with_name("meshes")


def library_names() -> tuple[str, ...]:
    """Names of the objects in the library, sorted."""
    return tuple(sorted(path.stem for path in LIBRARY_FOLDER.glob("*.ply")))


def library_file(name: str) -> Path | None:
    """The mesh file of the library object `name`, None for a name it does not have."""
    return LIBRARY_FOLDER / f"{name}.ply" if name in library_names() else None


def load_library_mesh(name: str, scale: float = 1.0) -> "ClosedMesh":
    """The library object `name`; raises `MeshError` for a name it does not have."""
    from manipnet.synthesis.objects.mesh import MeshError, load_mesh  # what only needs the names does without trimesh

    if name not in library_names():
        raise MeshError(f"no object {name!r} in the library; it has {', '.join(library_names())}")
    return load_mesh(LIBRARY_FOLDER / f"{name}.ply", scale=scale)
