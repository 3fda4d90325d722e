"""The hands in the scene: the skin of the model's hand, deformed by the bones of each message."""

from typing import Final

import numpy as np
import trimesh
import viser
from PIL import Image

from manipnet.geometry import Array, matrix_to_quat, mirror_points, mirror_quats
from manipnet.page.hand_look import HandLook
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.synthesizer import hand_to_world
from manipnet.wire import HandPose, Side

SKIN: Final = {"right": (226, 168, 138), "left": (213, 153, 128)}
PALE: Final = {"right": (176, 164, 158), "left": (168, 156, 151)}
"""The colour of a hand that is held or at rest."""
NAIL: Final = (238, 190, 172)
RAMP: Final = 64
"""Steps of opacity in the texture of a forearm."""
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
        self._cuffs: dict[bool, viser.GlbHandle] = {}
        if not ghost:
            if len(self._nail_bones):
                bones = self._nail_bones
                weights = (look.nails.bones[:, None] == bones).astype(np.float32)
                nails = look.nails
                self._nails = self._skinned(
                    "nails", nails.vertices, nails.faces, weights, positions[bones], quats[bones], NAIL
                )
            self._cuffs = {pale: self._cuff(pale) for pale in (False, True)}

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
        if self._ghost:
            return
        if self._pale != (hand.state != "live"):
            self._pale = hand.state != "live"
            self._mesh.color = (PALE if self._pale else SKIN)[self.side]
            for pale, cuff in self._cuffs.items():
                cuff.visible = pale == self._pale
        self._cuffs[self._pale].position, self._cuffs[self._pale].wxyz = positions[0], turned[0]

    def show(self, visible: bool) -> None:
        """Show or hide it."""
        self._root.visible = visible

    def remove(self) -> None:
        """Remove it from the scene."""
        self._root.remove()

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

    def _cuff(self, pale: bool) -> viser.GlbHandle:
        """The forearm that fades out, as a child of the wrist, in the colour of the skin."""
        vertices, faces, opacity = self._look.cuff
        _, rotations = forward_kinematics(self._hand, self._hand.skin.bind_angles)
        vertices = vertices @ rotations[0]
        if self.side == "left":
            vertices, faces = mirror_points(vertices), faces[:, ::-1]
        content = faded_mesh(self.scale * vertices, faces, opacity, (PALE if pale else SKIN)[self.side])
        name = f"{self._name}/cuff/{'pale' if pale else 'live'}"
        return self._scene.add_glb(name, content, cast_shadow=False, receive_shadow=False, visible=not pale)


def faded_mesh(vertices: Array, faces: np.ndarray, opacity: Array, color: tuple[int, int, int]) -> bytes:
    """A GLB file with a mesh of one colour, whose vertices have the given opacity."""
    ramp = np.empty((1, RAMP, 4), np.uint8)
    ramp[..., :3] = color
    ramp[..., 3] = np.linspace(0, 255, RAMP).round()
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Image.fromarray(ramp), alphaMode="BLEND", metallicFactor=0.0, roughnessFactor=0.6
    )
    inset = 0.5 / RAMP
    across = inset + (1.0 - 2.0 * inset) * opacity
    visual = trimesh.visual.TextureVisuals(np.column_stack([across, np.full_like(across, 0.5)]), material=material)
    content = trimesh.Trimesh(vertices, faces, visual=visual, process=False).export(
        file_type="glb", include_normals=True
    )
    assert isinstance(content, bytes)
    return content
