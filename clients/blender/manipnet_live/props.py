"""Tracked bodies as empties, with the meshes that the server has for them. A thread fetches the meshes."""

from __future__ import annotations

import base64
import threading
from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from .axes import quaternion, to_blender
from .manipnet_client import Body, ControlClient, RequestError
from .recording import Track
from .scene import Reference, own_object, rotate_to, rotation_of

ASK_EVERY_S = 2.0
TIMEOUT_S = 2.0


@dataclass(frozen=True)
class PropMesh:
    """The mesh of a body: `vertices (V, 3)` in metres in the body's frame and in Blender's axes, and `faces (F, 3)`."""

    key: tuple
    vertices: np.ndarray
    faces: np.ndarray


class MeshFetcher:
    """Asks the server which objects the bodies carry and fetches their meshes, on a thread that never uses Blender."""

    def __init__(self, address: str) -> None:
        """Raises `ValueError` for a wrong address."""
        self._control = ControlClient(address, timeout_s=TIMEOUT_S)
        self._stopping = threading.Event()
        self.meshes: dict[str, PropMesh] = {}
        self.problem = ""
        self._thread = threading.Thread(target=self._run, name="manipnet-meshes", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread; a request that waits for its answer delays this by at most two seconds."""
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                self._fetch()
                self.problem = ""
            except (OSError, RequestError, KeyError, ValueError) as error:
                self.problem = f"No meshes of props: {error}"
            self._stopping.wait(ASK_EVERY_S)

    def _fetch(self) -> None:
        for actor, bodies in self._control.ask("objects")["bodies"].items():
            for body, carried in bodies.items():
                if self._stopping.is_set():
                    return
                key = (carried["object"], carried["scale"], *carried["position"], *carried["rotation"])
                if body not in self.meshes or self.meshes[body].key != key:
                    answer = self._control.ask("mesh", body=body, actor=actor)
                    self.meshes[body] = _prop_mesh(key, carried, answer)


class Props:
    """The empties of tracked bodies in the scene. Only Blender's main thread may call the methods."""

    def __init__(self, control_address: str) -> None:
        """Raises `ValueError` for a wrong address."""
        self._fetcher = MeshFetcher(control_address)
        self._empties: dict[str, Reference] = {}
        self._shown: dict[str, tuple] = {}

    @property
    def problem(self) -> str:
        """Why there are no meshes, or an empty text."""
        return self._fetcher.problem

    def show(self, bodies: Sequence[Body]) -> None:
        """Move the empties of the bodies that are tracked, and give them their meshes."""
        for body in bodies:
            if not body.tracked:
                continue
            empty = self._empty(body.name)
            pose = to_blender(body.pose)
            empty.location = pose[:3]
            rotate_to(empty, quaternion(pose[3:]))
            mesh = self._fetcher.meshes.get(body.name)
            if mesh is not None:
                self._show_mesh(empty, body.name, mesh)

    def new_tracks(self) -> list[Track]:
        """A track for each body that has been seen."""
        return [Track(reference, ("",), ("",)) for reference in self._empties.values()]

    def record(self, tracks: Sequence[Track], time_s: float) -> None:
        """Add the present poses to tracks of `new_tracks`."""
        for track in tracks:
            if (empty := track.target.find()) is not None:
                track.add(time_s, np.array([rotation_of(empty)]), np.array([empty.location]))

    def close(self) -> None:
        """End the thread; the empties stay in the scene."""
        self._fetcher.close()

    def _empty(self, body: str) -> bpy.types.Object:
        known = self._empties.get(body)
        found = known.find() if known else None
        if found is None or not found.users_collection:
            found = own_object(f"manipnet_body_{body}", size_m=0.05)
            if known is None or known.find() is None:
                self._empties[body] = Reference(found)
        return found

    def _show_mesh(self, empty: bpy.types.Object, body: str, mesh: PropMesh) -> None:
        name = f"manipnet_mesh_{body}"
        if self._shown.get(body) == mesh.key and any(child.name.startswith(name) for child in empty.children):
            return
        data = bpy.data.meshes.new(name)
        data.from_pydata(mesh.vertices.tolist(), [], mesh.faces.tolist())
        shown = own_object(name, data)
        if shown.data != data:
            before, shown.data = shown.data, data
            if before.users == 0:
                bpy.data.meshes.remove(before)
        shown.parent, shown.matrix_parent_inverse = empty, Matrix.Identity(4)
        self._shown[body] = mesh.key


def _prop_mesh(key: tuple, carried: dict, answer: dict) -> PropMesh:
    vertices = np.frombuffer(base64.b64decode(answer["vertices"]), "<f4").reshape(-1, 3).astype(float)
    faces = np.frombuffer(base64.b64decode(answer["faces"]), "<u4").reshape(-1, 3)
    turn = np.array(quaternion(carried["rotation"]).to_matrix())
    x, y, z = (carried["scale"] * vertices @ turn.T + np.array(carried["position"])).T
    return PropMesh(key, np.column_stack([x, -z, y]), faces)
