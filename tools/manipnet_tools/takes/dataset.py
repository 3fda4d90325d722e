"""The folder of a dataset: takes in `BVH/<take>/` or generated ones in `takes/<take>/`, meshes in `meshes/`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

TAKE_FILE: Final = "take.npz"
"""The file of a generated take."""


class DataError(ValueError):
    """A folder does not have the layout of the dataset; the text says what is missing."""


def take_folders(data: Path, names: Sequence[str] = ()) -> list[Path]:
    """The folders of all takes, or of the takes in `names`. Raises `DataError`."""
    folders = sorted(path for path in (data / "BVH").glob("*") if path.is_dir())
    folders += sorted(path.parent for path in (data / "takes").glob(f"*/{TAKE_FILE}"))
    if not folders:
        raise DataError(
            f"{data}: contains no takes; it must have folders BVH/<take>/ with BVH files, or takes/<take>/{TAKE_FILE}"
        )
    found = {path.name: path for path in folders}
    if unknown := set(names) - found.keys():
        raise DataError(f"{data}: has no take {', '.join(sorted(unknown))}; it has {', '.join(sorted(found))}")
    return [found[name] for name in names or found]


def mesh_file(data: Path, name: str) -> Path:
    """The mesh of an object. Raises `DataError` if it does not exist."""
    path = data / "meshes" / f"{name}.obj"
    if not path.is_file():
        raise DataError(f"{data}: the mesh {path} does not exist")
    return path
