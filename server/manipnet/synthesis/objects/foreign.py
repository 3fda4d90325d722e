"""Files of other formats than those that are read as meshes, and the way round each."""

from pathlib import Path
from typing import Final

_BLENDER: Final = "open it in Blender (File > Import) and export it as glTF Binary (.glb) or OBJ"
_REMEDIES: Final = {
    "FBX": f"{_BLENDER}; FBX is usually in centimetres, so check the size there",
    "a Blender file": "open it in Blender and export it as glTF Binary (.glb) or OBJ",
    "USD": _BLENDER,
    "glTF in several files": "export it as glTF Binary (.glb), which is one file",
    "COLLADA": _BLENDER,
    "3MF": "export it as STL or OBJ",
    "a CAD model": "export its surface as STL",
    "Alembic": _BLENDER,
    "a file of Maya, 3ds Max, Cinema 4D or SketchUp": "export it from that program as OBJ or glTF Binary (.glb)",
}
"""What to do with a file, by what it is."""
SUFFIXES: Final = {
    ".fbx": "FBX",
    ".blend": "a Blender file",
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), "USD"),
    ".gltf": "glTF in several files",
    ".dae": "COLLADA",
    ".3mf": "3MF",
    **dict.fromkeys((".step", ".stp", ".iges", ".igs", ".sldprt", ".f3d"), "a CAD model"),
    ".abc": "Alembic",
    **dict.fromkeys((".ma", ".mb", ".max", ".3ds", ".c4d", ".skp"), "a file of Maya, 3ds Max, Cinema 4D or SketchUp"),
}
"""What files are, by the ends of their names."""
_BEGINNINGS: Final = {
    b"Kaydara FBX": "FBX",
    b"; FBX": "FBX",
    b"BLENDER": "a Blender file",
    b"PXR-USDC": "USD",
    b"#usda": "USD",
}
"""How such files begin, whatever they are called."""


def foreign_format(path: Path) -> str | None:
    """Why a file cannot be read as a mesh, and what to do, if it is of a format that is known but not read."""
    kind = SUFFIXES.get(path.suffix.lower())
    if kind is None and path.is_file():
        with path.open("rb") as file:
            beginning = file.read(64)
        if beginning.startswith(b"version https://git-lfs"):
            return "is only the pointer that Git LFS keeps in place of the file; fetch the file with `git lfs pull`"
        if beginning.startswith(b"glTF") and path.suffix.lower() != ".glb":
            return "is a glTF Binary; rename it to .glb"
        kind = next((kind for start, kind in _BEGINNINGS.items() if beginning.startswith(start)), None)
    return None if kind is None else f"is {kind}, which cannot be read; {_REMEDIES[kind]}"
