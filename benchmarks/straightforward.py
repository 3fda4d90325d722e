"""ManipNet's tick written in the straightforward way: trimesh for every query, PyTorch for the network, NumPy between.

It computes the same features as the product from the same meshes (`tests/tools/bench/test_straightforward.py` compares
them), without distance fields, trees of our own, caches or compiled code. `manipnet bench` compares the product with
it. It stops at the targets of inverse kinematics; a solver would only add to its time.
"""

from dataclasses import dataclass

import numpy as np
import torch
import trimesh

from manipnet.geometry import mirror_points, mirror_poses, quat_log, quat_multiply, quat_to_matrix
from manipnet.synthesis.model.layout import PRESENT, SENSED, WINDOW_STEP_S, layout_of
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.sensing.ambient import CELL_M, CELL_OFFSETS_M
from manipnet.synthesis.synthesizer import HandScene, HandState

HAND = shipped_hand()
LAYOUT = layout_of(HAND)

RANGE_M = 0.10
NEAR_M = 0.028


class Network(torch.nn.Module):
    """The paper's network with random weights."""

    mean: torch.Tensor
    deviation: torch.Tensor

    def __init__(self, width: int) -> None:
        super().__init__()
        self.columns = list(LAYOUT.encoded.values())
        self.encoders = torch.nn.ModuleList(torch.nn.Linear(c.stop - c.start, width // 3) for c in self.columns)
        self.layers = torch.nn.ModuleList(torch.nn.Linear(width, width) for _ in range(4))
        self.decoder = torch.nn.Linear(width, LAYOUT.output_size)
        self.register_buffer("mean", torch.zeros(LAYOUT.input_size))
        self.register_buffer("deviation", torch.ones(LAYOUT.input_size))

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Features `(N, input_size)` to outputs `(N, output_size)`."""
        x = (features - self.mean) / self.deviation
        x = torch.cat([encode(x[:, c]) for encode, c in zip(self.encoders, self.columns, strict=True)], dim=1)
        for first, second in (self.layers[:2], self.layers[2:]):
            a = torch.relu(x)
            c = torch.relu(first(a) + a)
            x = second(c) + c + a
        return self.decoder(x)


@dataclass
class View:
    """One instant of a scene as a right hand sees it, with the maps between its wrist frame and the object's."""

    wrist: np.ndarray
    object: np.ndarray
    mirrored: bool
    scale: float

    def to_object(self, points: np.ndarray) -> np.ndarray:
        """Points `(N, 3)` in the wrist frame, in the object's own metres."""
        return self.direction_to_object(points, self.wrist[:3] - self.object[:3]) / self.scale

    def direction_to_object(self, directions: np.ndarray, shift: np.ndarray | float = 0.0) -> np.ndarray:
        """Directions `(N, 3)` in the wrist frame, in the object's."""
        world = directions @ quat_to_matrix(self.wrist[3:]).T + shift
        local = world @ quat_to_matrix(self.object[3:])
        return mirror_points(local) if self.mirrored else local

    def direction_to_wrist(self, directions: np.ndarray) -> np.ndarray:
        """Directions `(N, 3)` in the object's frame, in the wrist's."""
        local = mirror_points(directions) if self.mirrored else directions
        return local @ quat_to_matrix(self.object[3:]).T @ quat_to_matrix(self.wrist[3:])


class Straightforward:
    """Ticks of hands that handle one mesh."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, width: int) -> None:
        self.mesh = trimesh.Trimesh(vertices, faces, process=False)
        self.network = Network(width).eval()

    def tick(self, scenes: list[HandScene], states: list[HandState]) -> list[tuple[np.ndarray, np.ndarray]]:
        """Joint positions and their targets, `(22, 3)` each, of every hand."""
        rows = np.stack([self.features(scene, state) for scene, state in zip(scenes, states, strict=True)])
        with torch.no_grad():
            outputs = self.network(torch.from_numpy(rows)).numpy()
        return [self._targets(scene, output) for scene, output in zip(scenes, outputs, strict=True)]

    def features(self, scene: HandScene, state: HandState) -> np.ndarray:
        """The network's inputs `(input_size,)` for one hand, float32."""
        row = np.empty(LAYOUT.input_size, np.float32)

        def put(name: str, values: np.ndarray) -> None:
            row[LAYOUT.input[name].columns] = values.reshape(-1)

        put("joint_positions", state.positions)
        put("joint_axes", _axes(np.concatenate([state.rotations, state.rotations[HAND.parents[17:]]])))
        self._put_trajectories(scene, put)
        views = [_view(scene, t) for t in SENSED]
        points, normals = _skin(state)
        put("ambient", self._ambient(views[0]))
        put("proximity", np.stack([self._proximity(view, points, normals) for view in views]))
        sensed = [self._distances(view, state.positions) for view in views]
        put("signed_distances", np.stack([np.minimum(distances, RANGE_M) for distances, _ in sensed]))
        put("surface_normals", sensed[0][1])
        return row

    def _put_trajectories(self, scene: HandScene, put) -> None:
        views = [_view(scene, t) for t in range(len(scene.wrist))]
        wrist, obj = np.stack([v.wrist for v in views]), np.stack([v.object for v in views])
        frame, origin = quat_to_matrix(wrist[PRESENT, 3:]), wrist[PRESENT, :3]
        assert scene.other_wrist is not None
        other = scene.other_wrist[:, :3]
        other = mirror_points(other) if scene.side == "left" else other
        center = self.mesh.center_mass * scene.scale
        center = mirror_points(center) if scene.side == "left" else center
        centers = obj[:, :3] + quat_to_matrix(obj[:, 3:]) @ center
        turns = quat_log(quat_multiply(obj[1:, 3:], obj[:-1, 3:] * [-1.0, -1.0, -1.0, 1.0])) / WINDOW_STEP_S
        put("wrist_positions", (wrist[:, :3] - origin) @ frame)
        put("wrist_axes", _axes(frame.T @ quat_to_matrix(wrist[:, 3:])))
        put("other_wrist_distances", np.linalg.norm(other - origin, axis=1))
        put("object_centers", (centers - origin) @ frame)
        put("object_angular_velocities", np.concatenate([turns[:1], turns]) @ frame)

    def _ambient(self, view: View) -> np.ndarray:
        points = view.to_object(HAND.sensors.grid_center + CELL_OFFSETS_M)
        closest, distance, _ = trimesh.proximity.closest_point(self.mesh, points)
        offset = np.abs(view.direction_to_wrist(closest - points)) * view.scale
        meets = np.all(offset <= 0.5 * CELL_M, axis=1)
        outside = np.where(meets, 1.0 - distance * view.scale / CELL_M, 0.0)
        return np.where(self.mesh.contains(points), 1.0, outside)

    def _proximity(self, view: View, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        origins, directions = view.to_object(points), view.direction_to_object(normals)
        inside = self.mesh.contains(origins)
        directions = np.where(inside[:, None], -directions, directions)
        hits, rays, _ = self.mesh.ray.intersects_location(origins, directions, multiple_hits=False)
        distance = np.full(len(origins), np.inf)
        distance[rays] = np.linalg.norm(hits - origins[rays], axis=1) * view.scale
        return np.where(inside, -1.0, 1.0) * np.minimum(distance, RANGE_M)

    def _distances(self, view: View, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        points = view.to_object(joints)
        closest, distance, _ = trimesh.proximity.closest_point(self.mesh, points)
        sign = np.where(self.mesh.contains(points), -1.0, 1.0)
        outward = sign[:, None] * (points - closest) / np.maximum(distance, 1e-12)[:, None]
        return sign * distance * view.scale, view.direction_to_wrist(outward)

    def _targets(self, scene: HandScene, output: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        joints = output[LAYOUT.output["joint_positions"].columns].reshape(22, 3)
        predicted = np.clip(output[LAYOUT.output["distances"].columns], 0.0, 0.035)
        measured, outward = self._distances(_view(scene, PRESENT), joints)
        final = np.where(measured < 0.0, 0.8 * predicted + 0.2 * measured, 0.2 * predicted + 0.8 * measured)
        step = np.where(predicted <= NEAR_M, final - measured, 0.0)
        return joints, joints + step[:, None] * outward


def _view(scene: HandScene, t: int) -> View:
    mirrored = scene.side == "left"
    poses = (
        (mirror_poses(scene.wrist[t]), mirror_poses(scene.object[t])) if mirrored else (scene.wrist[t], scene.object[t])
    )
    return View(*poses, mirrored, scene.scale)


def _axes(rotations: np.ndarray) -> np.ndarray:
    """The first two axes `(N, 2, 3)` of rotations `(N, 3, 3)`."""
    return np.swapaxes(rotations[..., :2], -1, -2)


def _skin(state: HandState) -> tuple[np.ndarray, np.ndarray]:
    """Points and unit normals `(104, 3)` of the sensors on the posed hand."""
    rotations, positions = state.rotations[HAND.sensors.bones], state.positions[HAND.sensors.bones]
    points = positions + np.einsum("skij,skj->ski", rotations, HAND.sensors.points)
    normals = np.einsum("skij,skj->ski", rotations, HAND.sensors.normals)
    points, normals = (np.einsum("sk,ski->si", HAND.sensors.weights, values) for values in (points, normals))
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)
