"""Meshes of a take's objects: those named on the command line or in a rig, and those in a recording."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from manipnet.config.settings import parse_mesh
from manipnet.recording.mcap_file import read_about
from manipnet.synthesis.objects.mesh import ClosedMesh, MeshError, load_mesh
from manipnet_tools.takes.take import TakeError


@dataclass(frozen=True)
class MeshFile:
    """A mesh file with its unit and scale."""

    path: Path
    unit: str = "m"
    scale: float = 1.0

    def load(self) -> ClosedMesh:
        """The mesh in metres. Raises `MeshError`."""
        return load_mesh(self.path, self.unit, self.scale)


def named_files(texts: Sequence[str], names: Iterable[str] | None = None) -> dict[str, Path]:
    """Files by name from the options `--mesh NAME=FILE`, where NAME must be one of `names` if they are given.

    Raises `ConfigError` for another text, and `TakeError` for another name.
    """
    files: dict[str, Path] = {}
    for text in texts:
        name, file = parse_mesh(text)
        if names is not None and name not in names:
            raise TakeError(
                f"--mesh {text}: no object is called {name!r}; the objects are {', '.join(names) or 'none'}"
            )
        files[name] = file
    return files


def recorded_meshes(recording: Path) -> dict[str, ClosedMesh]:
    """The meshes in a recording, by object. Raises `RecordingError`, and `MeshError` for a damaged mesh."""
    meshes = {}
    with TemporaryDirectory() as folder:
        for name, content in read_about(recording).meshes.items():
            file = Path(folder) / name
            file.write_bytes(content)
            try:
                meshes[file.stem] = load_mesh(file)
            except MeshError as error:
                reason = str(error).removeprefix(f"{file}: ")
                raise MeshError(
                    f"{recording}: the mesh {name} in it: {reason}; give another one with --mesh {file.stem}=FILE"
                ) from None
    return meshes
