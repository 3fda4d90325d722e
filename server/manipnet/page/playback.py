"""Recordings on the page: the hands of an MCAP file, as a frame at any instant."""

import json
import tempfile
from bisect import bisect_left
from dataclasses import dataclass
from pathlib import Path

from manipnet.actors.body_roles import NO_OFFSET
from manipnet.page.frames import Frame, PropView, ShapeView
from manipnet.recording.mcap_file import About, RecordingError, read_about, read_hands
from manipnet.synthesis.objects.library import library_names, load_library_mesh
from manipnet.synthesis.objects.mesh import ClosedMesh, MeshError, load_mesh
from manipnet.wire import HandsMessage


@dataclass(frozen=True, eq=False)
class Recording:
    """What the page shows of a file: the hands of its first actor, and the shapes of its props by hash."""

    name: str
    messages: tuple[HandsMessage, ...]
    props: tuple[PropView, ...]
    shapes: dict[str, ShapeView]

    @property
    def seconds(self) -> float:
        """Its duration."""
        return self.messages[-1].t_capture - self.messages[0].t_capture

    def at(self, second: float) -> Frame:
        """The tick at or after `second`, counted from the beginning. What the hands sensed is not recorded."""
        begin_s = self.messages[0].t_capture
        index = bisect_left(self.messages, begin_s + second, key=lambda message: message.t_capture)
        return Frame(self.messages[min(index, len(self.messages) - 1)], self.props, {}, {})


def read_recording(path: Path) -> Recording:
    """Read a recording. Raises `RecordingError`, also if it holds no hands or its metadata is damaged."""
    messages = list(read_hands(path))
    if not messages:
        raise RecordingError(f"{path.name}: holds bodies but no hands; play it to a server with `manipnet replay`")
    messages = tuple(message for message in messages if message.actor == messages[0].actor)
    props, shapes = [], {}
    try:
        meshes = _meshes(read_about(path))
    except (AttributeError, TypeError, ValueError) as error:
        raise RecordingError(f"{path.name}: the metadata about its objects is damaged: {error}") from None
    for name, (mesh, scale) in meshes.items():
        shapes[mesh.content_hash] = ShapeView(mesh.name, mesh.content_hash, mesh.vertices, mesh.faces)
        props.append(PropView(name, mesh.name, mesh.content_hash, scale, NO_OFFSET))
    return Recording(path.name, messages, tuple(props), shapes)


def _meshes(about: About) -> dict[str, tuple[ClosedMesh, float]]:
    """The mesh and the scale of each body; a mesh that cannot be read is left out."""
    meshes: dict[str, tuple[ClosedMesh, float]] = {}
    for body, carried in json.loads(about.metadata.get("objects", "{}")).items():
        if carried.get("object") in library_names():
            meshes[body] = load_library_mesh(carried["object"]), float(carried.get("scale", 1.0))
    with tempfile.TemporaryDirectory() as folder:
        for name, content in about.meshes.items():
            path = Path(folder) / Path(name).name
            path.write_bytes(content)
            try:
                meshes[path.stem] = load_mesh(path), 1.0
            except MeshError:
                continue
    return meshes
