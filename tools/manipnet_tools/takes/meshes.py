"""Meshes of a take's objects: those named on the command line or in a rig, and those a recording keeps."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from manipnet.recording.mcap_file import read_about
from manipnet.synthesis.objects.mesh import ClosedMesh, MeshError, load_mesh
from manipnet_tools.takes.take import TakeError


@dataclass(frozen=True)
class MeshFile:
    """A mesh file, and how it is read."""

    path: Path
    unit: str = "m"
    scale: float = 1.0

    def load(self) -> ClosedMesh:
        """The mesh in metres. Raises `MeshError`."""
        return load_mesh(self.path, self.unit, self.scale)


def named_files(texts: Sequence[str], names: Iterable[str]) -> dict[str, Path]:
    """Files by object from `NAME=FILE`, NAME one of `names`. Raises `TakeError`."""
    names = tuple(names)
    files = {}
    for text in texts:
        name, equals, file = text.partition("=")
        if not equals or name not in names:
            raise TakeError(f"--mesh {text}: must be NAME=FILE with NAME one of {', '.join(names) or 'none'}")
        files[name] = Path(file)
    return files


def recorded_meshes(recording: Path) -> dict[str, ClosedMesh]:
    """The meshes a recording keeps, by object. Raises `RecordingError`, and `MeshError` for a damaged one."""
    meshes = {}
    with TemporaryDirectory() as folder:
        for name, content in read_about(recording).meshes.items():
            file = Path(folder) / name
            file.write_bytes(content)
            try:
                meshes[file.stem] = load_mesh(file)
            except MeshError as error:
                reason = str(error).removeprefix(f"{file}: ")
                raise MeshError(f"{recording}: its mesh {name}: {reason}; give --mesh {file.stem}=FILE") from None
    return meshes
