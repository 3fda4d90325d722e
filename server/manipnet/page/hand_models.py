"""The hands in the scene: the skin of the model's hand, deformed by the bones of each message."""

from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array, matrix_to_quat, mirror_points, mirror_quats
from manipnet.page.forearm import Forearm
from manipnet.page.hand_look import HandLook
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.synthesizer import hand_to_world
from manipnet.wire import HandPose, Side

SKIN: Final = {"right": (226, 168, 138), "left": (213, 153, 128)}
PALE: Final = {"right": (176, 164, 158), "left": (168, 156, 151)}
"""The colour of a hand that is held or at rest."""
NAIL: Final = (238, 190, 172)
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
        self, scene: viser.SceneApi, name: str, look: HandLook, side: Side, scale: float, ghost: bool = False
    ) -> None:
        self.side: Side = side
        self.scale = scale
        self._look, self._hand, self._ghost, self._pale = look, look.hand, ghost, False
        self._scene, self._name = scene, name
        hand = look.hand
        positions, matrices = forward_kinematics(hand, hand.skin.bind_angles)
        quats = matrix_to_quat(matrices)
        if side == "left":
            positions, quats = mirror_points(positions), mirror_quats(quats)
        self._root = scene.add_frame(name, show_axes=False)
        self._mesh = self._skinned("skin", look.vertices, look.faces, look.weights, positions, quats, SKIN[side])
        self._nails: viser.MeshSkinnedHandle | None = None
        self._nail_bones = np.unique(look.nails.bones)
        self._arm: Forearm | None = None
        if not ghost:
            if len(self._nail_bones):
                bones = self._nail_bones
                weights = (look.nails.bones[:, None] == bones).astype(np.float32)
                nails = look.nails
                self._nails = self._skinned(
                    "nails", nails.vertices, nails.faces, weights, positions[bones], quats[bones], NAIL
                )
            self._arm = self._forearm()

    def pose(self, hand: HandPose, wrist: Array | None = None) -> None:
        """Take the pose of a message's hand, at its own wrist or at another `wrist (7,)`."""
        wrist = hand.wrist if wrist is None else wrist
        positions, quats = world_bones(self._hand, self.side, self.scale, hand.angles, wrist)
        turned = wxyz(quats)
        for bone, position, quat in zip(self._mesh.bones, positions, turned, strict=False):
            bone.position, bone.wxyz = position, quat
        if self._nails is not None:
            for bone, number in zip(self._nails.bones, self._nail_bones, strict=True):
                bone.position, bone.wxyz = positions[number], turned[number]
        if self._arm is None:
            return
        if self._pale != (hand.state != "live"):
            self._pale = hand.state != "live"
            self._mesh.color = (PALE if self._pale else SKIN)[self.side]
            self._arm.paint(self._mesh.color)
        self._arm.pose(positions[0], turned[0])

    def show(self, visible: bool) -> None:
        """Show or hide it."""
        self._root.visible = visible

    def _skinned(
        self,
        part: str,
        vertices: Array,
        faces: np.ndarray,
        weights: np.ndarray,
        positions: Array,
        quats: Array,
        color: tuple[int, int, int],
    ) -> viser.MeshSkinnedHandle:
        if self.side == "left":
            vertices, faces = mirror_points(vertices), faces[:, ::-1]
        return self._scene.add_mesh_skinned(
            f"{self._name}/{part}",
            self.scale * vertices,
            faces,
            bone_wxyzs=wxyz(quats),
            bone_positions=self.scale * positions[: weights.shape[1]],
            skin_weights=weights,
            color=GHOST if self._ghost else color,
            opacity=0.22 if self._ghost else None,
            cast_shadow=not self._ghost,
            receive_shadow=not self._ghost,
        )

    def _forearm(self) -> Forearm:
        vertices, faces, opacity = self._look.cuff
        _, rotations = forward_kinematics(self._hand, self._hand.skin.bind_angles)
        vertices = vertices @ rotations[0]
        if self.side == "left":
            vertices, faces = mirror_points(vertices), faces[:, ::-1]
        return Forearm(self._scene, f"{self._name}/forearm", self.scale * vertices, faces, opacity, SKIN[self.side])
