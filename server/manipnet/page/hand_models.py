"""Hands as people see them: the project's own skin, bent by the bones of each message."""

from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array, matrix_to_quat, mirror_points, mirror_quats
from manipnet.synthesis.hand.bind_pose import BIND_ANGLES_RAD
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.skeleton import BONE_COUNT
from manipnet.synthesis.hand.surface import BONES, FACES, VERTICES, WEIGHTS
from manipnet.synthesis.synthesizer import hand_to_world
from manipnet.wire import HandPose, Side

SKIN: Final = {"right": (226, 168, 138), "left": (213, 153, 128)}
PALE: Final = {"right": (176, 164, 158), "left": (168, 156, 151)}
"""A hand that is not live: held, or at rest."""
GHOST: Final = (140, 190, 255)
_DENSE_WEIGHTS: Final = np.zeros((len(VERTICES), BONE_COUNT), np.float32)
np.add.at(_DENSE_WEIGHTS, (np.arange(len(VERTICES))[:, None], BONES), WEIGHTS)


def wxyz(q: Array) -> Array:
    """Quaternions xyzw as viser has them."""
    return q[..., [3, 0, 1, 2]]


def world_bones(side: Side, scale: float, angles: Array, wrist: Array) -> tuple[Array, Array]:
    """Joint positions `(22, 3)` and bone rotations `(17, 4)` in the world of a hand in a pose."""
    positions, rotations = forward_kinematics(np.asarray(angles, np.float64))
    return hand_to_world(side, np.asarray(wrist, np.float64), positions * scale, rotations)


class HandModel:
    """One hand in the scene under `name`; `ghost` makes it a translucent one."""

    def __init__(self, scene: viser.SceneApi, name: str, side: Side, scale: float, ghost: bool = False) -> None:
        self.side: Side = side
        self.scale = scale
        self._ghost, self._pale = ghost, False
        positions, matrices = forward_kinematics(BIND_ANGLES_RAD)
        quats, vertices, faces = matrix_to_quat(matrices), VERTICES, FACES
        if side == "left":
            positions, quats, vertices = mirror_points(positions), mirror_quats(quats), mirror_points(vertices)
            faces = faces[:, ::-1]
        self._mesh = scene.add_mesh_skinned(
            name,
            scale * vertices,
            faces,
            bone_wxyzs=wxyz(quats),
            bone_positions=scale * positions[:BONE_COUNT],
            skin_weights=_DENSE_WEIGHTS,
            color=GHOST if ghost else SKIN[side],
            opacity=0.22 if ghost else None,
            cast_shadow=not ghost,
            receive_shadow=not ghost,
        )

    def pose(self, hand: HandPose, wrist: Array | None = None) -> None:
        """Bend to a message's hand; `wrist (7,)` puts it elsewhere."""
        positions, quats = world_bones(self.side, self.scale, hand.angles, hand.wrist if wrist is None else wrist)
        for bone, position, quat in zip(self._mesh.bones, positions, wxyz(quats), strict=False):
            bone.position, bone.wxyz = position, quat
        if not self._ghost and self._pale != (hand.state != "live"):
            self._pale = hand.state != "live"
            self._mesh.color = (PALE if self._pale else SKIN)[self.side]

    def show(self, visible: bool) -> None:
        """Show or hide it."""
        self._mesh.visible = visible

    def remove(self) -> None:
        """Take it out of the scene."""
        self._mesh.remove()
