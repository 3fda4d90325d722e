"""The objects that come with the server, by name: generated meshes in metres, Y up."""

from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from manipnet.synthesis.objects.mesh import ClosedMesh

LIBRARY_FOLDER: Final = Path(__file__).with_name("meshes")


def library_names() -> tuple[str, ...]:
    """Names of the objects in the library, sorted."""
    return tuple(sorted(path.stem for path in LIBRARY_FOLDER.glob("*.ply")))


def library_file(name: str) -> Path | None:
    """The mesh file of a library object; None if there is no object of this name."""
    return LIBRARY_FOLDER / f"{name}.ply" if name in library_names() else None


def load_library_mesh(name: str, scale: float = 1.0) -> "ClosedMesh":
    """The mesh of a library object. Raises `MeshError` if there is no object of this name."""
    from manipnet.synthesis.objects.mesh import MeshError, load_mesh  # reading the names takes no trimesh

    if name not in library_names():
        raise MeshError(f"the library has no object {name!r}; it has {', '.join(library_names())}")
    return load_mesh(LIBRARY_FOLDER / f"{name}.ply", scale=scale)
