"""The hands in the scene: the skin of the model's hand, deformed by the bones of each message."""

from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array, matrix_to_quat, mirror_points, mirror_quats
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.synthesizer import hand_to_world
from manipnet.wire import HandPose, Side

SKIN: Final = {"right": (226, 168, 138), "left": (213, 153, 128)}
PALE: Final = {"right": (176, 164, 158), "left": (168, 156, 151)}
"""The colour of a hand that is held or at rest."""
GHOST: Final = (140, 190, 255)


def wxyz(q: Array) -> Array:
    """Quaternions xyzw in viser's order, wxyz."""
    return q[..., [3, 0, 1, 2]]


def world_bones(hand: Hand, side: Side, scale: float, angles: Array, wrist: Array) -> tuple[Array, Array]:
    """World positions `(22, 3)` of the joints and rotations `(17, 4)` of the bones of a hand."""
    positions, rotations = forward_kinematics(hand, np.asarray(angles, np.float64))
    return hand_to_world(side, np.asarray(wrist, np.float64), positions * scale, rotations)


class HandModel:
    """One hand in the scene under `name`; `ghost` makes it translucent."""

    def __init__(
        self, scene: viser.SceneApi, name: str, hand: Hand, side: Side, scale: float, ghost: bool = False
    ) -> None:
        self.side: Side = side
        self.scale = scale
        self._hand, self._ghost, self._pale = hand, ghost, False
        positions, matrices = forward_kinematics(hand, hand.skin.bind_angles)
        quats, vertices, faces = matrix_to_quat(matrices), hand.skin.vertices, hand.skin.faces
        if side == "left":
            positions, quats, vertices = mirror_points(positions), mirror_quats(quats), mirror_points(vertices)
            faces = faces[:, ::-1]
        self._mesh = scene.add_mesh_skinned(
            name,
            scale * vertices,
            faces,
            bone_wxyzs=wxyz(quats),
            bone_positions=scale * positions[: hand.bone_count],
            skin_weights=_dense_weights(hand),
            color=GHOST if ghost else SKIN[side],
            opacity=0.22 if ghost else None,
            cast_shadow=not ghost,
            receive_shadow=not ghost,
        )

    def pose(self, hand: HandPose, wrist: Array | None = None) -> None:
        """Take the pose of a message's hand, at its own wrist or at another `wrist (7,)`."""
        wrist = hand.wrist if wrist is None else wrist
        positions, quats = world_bones(self._hand, self.side, self.scale, hand.angles, wrist)
        for bone, position, quat in zip(self._mesh.bones, positions, wxyz(quats), strict=False):
            bone.position, bone.wxyz = position, quat
        if not self._ghost and self._pale != (hand.state != "live"):
            self._pale = hand.state != "live"
            self._mesh.color = (PALE if self._pale else SKIN)[self.side]

    def show(self, visible: bool) -> None:
        """Show or hide it."""
        self._mesh.visible = visible

    def remove(self) -> None:
        """Remove it from the scene."""
        self._mesh.remove()


def _dense_weights(hand: Hand) -> np.ndarray:
    """The skin's weights for every bone, `(V, B)` float32."""
    weights = np.zeros((len(hand.skin.vertices), hand.bone_count), np.float32)
    np.add.at(weights, (np.arange(len(weights))[:, None], hand.skin.bones), hand.skin.weights)
    return weights
