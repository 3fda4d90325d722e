"""Writes the motion of hands as BVH on the skeleton of an avatar, whose bones keep their names and lengths.

All coordinates are right-handed. A file of an avatar in BVH keeps its unit and order of joints; the skeleton of another
format is written in centimetres. Each joint has the axes of the world at rest, as in every BVH file, and the joint of
the hand has position channels too, because the arm above it stays at rest.
"""

from pathlib import Path
from typing import Final

import numpy as np

from manipnet.geometry import Array, quat_conjugate, quat_multiply, transform
from manipnet.synthesis.hand.profile import FINGERS
from manipnet_tools.export.animation import Animation
from manipnet_tools.export.avatar_motion import AvatarMotion
from manipnet_tools.export.bvh_out import CENTIMETRES_PER_M, Space, motion_lines, new_folder, object_texts

_ROTATIONS: Final = "Yrotation Xrotation Zrotation"
_POSITIONS: Final = "Xposition Yposition Zposition"


def write_avatar_bvh(animation: Animation, avatar: AvatarMotion, folder: Path, replace: bool = False) -> list[Path]:
    """Write the avatar's skeleton as `<profile>.bvh`, and `<object>.bvh` files; returns the files.

    Raises `ExportError` if the folder already contains BVH files, unless they are to be replaced.
    """
    new_folder(folder, replace)
    rig = avatar.rig
    space = Space(CENTIMETRES_PER_M if rig.skeleton.in_metres else 1.0 / rig.unit, mirrored=False)
    texts = {rig.profile.name: _Writer(avatar, space).text(animation.rate_hz)}
    texts |= object_texts(animation, space)
    for stem, text in texts.items():
        (folder / f"{stem}.bvh").write_text(text, encoding="utf-8")
    return [folder / f"{stem}.bvh" for stem in texts]


class _Writer:
    """Writes the joints depth first, and collects their channels in the same order."""

    def __init__(self, avatar: AvatarMotion, space: Space) -> None:
        self._avatar, self._skeleton, self._space = avatar, avatar.rig.skeleton, space
        self._heads = avatar.rig.unit * self._skeleton.heads
        self._frames = len(next(iter(avatar.joints.values())))
        self._columns: list[Array] = []
        self._kept = _kept_bones(avatar)
        self._tips = {
            hand.bones[row[-2]]: hand.bind[row[-1], :3]
            for hand in avatar.rig.hands.values()
            for row in FINGERS
            if row[-2] in hand.bones
        }
        nodes = self._skeleton.document[0].get("nodes", [])
        self._names = [str(node.get("name", n)) for n, node in enumerate(nodes)] or self._skeleton.names

    def text(self, rate_hz: float) -> str:
        roots = [bone for bone in self._kept if self._skeleton.parents[bone] not in self._kept]
        if len(roots) == 1:
            lines = self._joint(roots[0], "ROOT", np.zeros(3), "")
        else:  # the format has one root
            self._add_columns(None, np.zeros(3), has_position=True)
            below = [line for bone in roots for line in self._joint(bone, "JOINT", np.zeros(3), "\t")]
            lines = ["ROOT Scene", "{", "\tOFFSET 0 0 0", f"\tCHANNELS 6 {_POSITIONS} {_ROTATIONS}", *below, "}"]
        return "\n".join(["HIERARCHY", *lines, *motion_lines(np.concatenate(self._columns, axis=1), rate_hz)])

    def _joint(self, bone: int, kind: str, above: Array, indent: str) -> list[str]:
        moved = self._avatar.bones.get(bone)
        offset = self._heads[bone] - above
        has_position = kind == "ROOT" or (moved is not None and moved.is_hand)
        self._add_columns(bone, offset, has_position)
        channels = f"CHANNELS 6 {_POSITIONS} {_ROTATIONS}" if has_position else f"CHANNELS 3 {_ROTATIONS}"
        children = [child for child in self._skeleton.children(bone) if child in self._kept]
        below = [line for child in children for line in self._joint(child, "JOINT", self._heads[bone], f"{indent}\t")]
        if not children:
            end = self._space.text(self._end(bone))
            below = [f"{indent}\tEnd Site", f"{indent}\t{{", f"{indent}\t\tOFFSET {end}", f"{indent}\t}}"]
        head = [f"{indent}{kind} {self._names[bone]}", f"{indent}{{"]
        return [*head, f"{indent}\tOFFSET {self._space.text(offset)}", f"{indent}\t{channels}", *below, f"{indent}}}"]

    def _end(self, bone: int) -> Array:
        """Where a bone without children ends, relative to its head."""
        if bone in self._skeleton.ends:
            return self._avatar.rig.unit * self._skeleton.ends[bone] - self._heads[bone]
        return self._tips[bone] - self._heads[bone] if bone in self._tips else np.zeros(3)

    def _add_columns(self, bone: int | None, offset: Array, has_position: bool) -> None:
        """Add the channels of a joint with an `offset (3,)` from the joint above."""
        moved = None if bone is None else self._avatar.bones.get(bone)
        turns, places = np.tile([0.0, 0, 0, 1], (self._frames, 1)), np.tile(offset, (self._frames, 1))
        if moved is not None:
            turns = quat_multiply(quat_conjugate(moved.parent_move[:, 3:]), moved.move[:, 3:])
            if moved.is_hand:
                places = transform(moved.move, self._heads[bone]) - (self._heads[bone] - offset)
        if has_position:
            self._columns.append(self._space.points(places))
        self._columns.append(self._space.degrees(turns))


def _kept_bones(avatar: AvatarMotion) -> set[int]:
    """The bones of a rig without what is no bone of it, such as the nodes of meshes."""
    skeleton = avatar.rig.skeleton
    if skeleton.joints:
        return set(range(len(skeleton.names)))
    skins = skeleton.document[0].get("skins", [])
    kept = {int(joint) for skin in skins for joint in skin["joints"]}
    kept |= {bone for hand in avatar.rig.hands.values() for bone in hand.bones.values()}
    for bone in list(kept):
        while (bone := skeleton.parents[bone]) >= 0:
            kept.add(bone)
    return kept
