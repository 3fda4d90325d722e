"""The hands of an avatar in the scene: their skin, bent by the 26 OpenXR joints of each message."""

from typing import Final

import numpy as np
import trimesh
import viser

from manipnet.geometry import SIDES, Array
from manipnet.page.forearm import Forearm
from manipnet.page.hand_models import PALE, SKIN, wxyz
from manipnet.synthesis.hand.profile import HandProfile, ProfileHand
from manipnet.synthesis.hand.shipped import HandMesh
from manipnet.wire import HandPose, Side
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES, OPENXR_PARENTS

WRIST: Final = OPENXR_JOINT_NAMES.index("wrist")
PALM: Final = OPENXR_JOINT_NAMES.index("palm")
THIN_M: Final = 0.006
"""The radius of a joint of which nothing is known."""

AvatarLook = dict[Side, HandMesh]


class AvatarModel:
    """One hand of an avatar under `name`."""

    def __init__(self, scene: viser.SceneApi, name: str, mesh: HandMesh, side: Side) -> None:
        self._side: Side = side
        self._pale = False
        self._root = scene.add_frame(name, show_axes=False)
        solid = (mesh.opacity[mesh.faces] > 0.999).any(axis=1)
        weights = np.zeros((len(mesh.vertices), len(mesh.bind)), np.float32)
        np.add.at(weights, (np.arange(len(weights))[:, None], mesh.bones), mesh.weights)
        self._mesh = scene.add_mesh_skinned(
            f"{name}/skin",
            mesh.vertices,
            mesh.faces[solid],
            bone_wxyzs=wxyz(mesh.bind[:, 3:]),
            bone_positions=mesh.bind[:, :3],
            skin_weights=weights,
            color=SKIN[side],
        )
        self._arm: Forearm | None = None
        if not solid.all():
            arm = f"{name}/forearm"
            self._arm = Forearm(scene, arm, mesh.vertices, mesh.faces[~solid], mesh.opacity, SKIN[side])

    def pose(self, hand: HandPose) -> None:
        """Take the pose of a message's hand."""
        turned = wxyz(hand.joints[:, 3:])
        for bone, position, quat in zip(self._mesh.bones, hand.joints[:, :3], turned, strict=True):
            bone.position, bone.wxyz = position, quat
        if self._arm is not None:
            self._arm.pose(hand.joints[WRIST, :3], turned[WRIST])
        if self._pale != (hand.state != "live"):
            self._pale = hand.state != "live"
            self._mesh.color = (PALE if self._pale else SKIN)[self._side]
            if self._arm is not None:
                self._arm.paint(self._mesh.color)

    def show(self, visible: bool) -> None:
        """Show or hide it."""
        self._root.visible = visible


def plain_look(profile: HandProfile) -> AvatarLook:
    """A mannequin's hands for a profile without a skin: a capsule for each bone, as thick as the profile says."""
    return {side: _mannequin(profile.hands[side]) for side in SIDES}


def _mannequin(hand: ProfileHand) -> HandMesh:
    missing = np.asarray(np.isnan(hand.joints).any(axis=1))
    bind = hand.joints.copy()
    for joint in [WRIST, *range(len(bind))]:
        if missing[joint]:
            bind[joint] = bind[max(OPENXR_PARENTS[joint], 0)] if joint != WRIST else (0, 0, 0, 0, 0, 0, 1)
    vertices, faces, bones = list[Array](), list[np.ndarray](), list[np.ndarray]()
    for joint, parent in enumerate(OPENXR_PARENTS):
        if missing[joint] or parent < 0 or joint == PALM:
            continue
        radius = hand.radii[joint] if np.isfinite(hand.radii[joint]) else THIN_M
        capsule = _capsule(bind[parent, :3], bind[joint, :3], float(radius))
        faces.append(capsule.faces + sum(map(len, vertices)))
        vertices.append(np.asarray(capsule.vertices))
        bones.append(np.full(len(capsule.vertices), parent))
    owner = np.concatenate(bones)
    number = np.zeros((len(owner), 4), np.int64)
    number[:, 0] = owner
    weights = np.tile([1.0, 0.0, 0.0, 0.0], (len(owner), 1))
    return HandMesh(np.concatenate(vertices), np.concatenate(faces), number, weights, bind, np.ones(len(owner)))


def _capsule(start: Array, end: Array, radius: float) -> trimesh.Trimesh:
    """A capsule from one point to another."""
    away = end - start
    length = max(float(np.linalg.norm(away)), 1e-6)
    capsule = trimesh.creation.capsule(length, radius, count=(10, 12))
    capsule.apply_transform(trimesh.geometry.align_vectors((0.0, 0.0, 1.0), away / length))
    capsule.apply_translation(start)
    return capsule
