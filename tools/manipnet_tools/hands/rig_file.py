"""Reads the skeleton of an avatar from a glTF Binary, VRM or BVH file."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array
from manipnet.synthesis.objects.glb import glb_chunks, read_glb_rig
from manipnet.synthesis.objects.glb_accessors import GlbError
from manipnet.wire.rig_names import plain
from manipnet_tools.commands.options import RIG_SUFFIXES
from manipnet_tools.takes.bvh_motion import BvhError, Joint, read_bvh


class RigFileError(ValueError):
    """A hand cannot be imported from a file; the text names the file, the reason and the remedy."""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The bones of a rig at rest, in the units of the file."""

    names: list[str]
    parents: list[int]
    heads: Array
    """`(B, 3)` where each bone begins."""
    ends: dict[int, Array]
    """Where bones without children end, as far as the file says so."""
    vertices: Array
    """`(V, 3)` the skin; a BVH file has none."""
    faces: NDArray[np.int64]
    """`(F, 3)`"""
    owners: NDArray[np.int64]
    """`(V, 4)` the bones that move each vertex."""
    weights: Array
    """`(V, 4)` how much each of them moves it."""
    in_metres: bool
    """Whether the format has metres as its unit."""
    document: tuple[dict[str, Any], bytes] = ({}, b"")
    """The JSON document and the binary chunk of a glTF file; its bones have the numbers of the nodes."""
    joints: tuple[Joint, ...] = ()
    """The joints of a BVH file."""
    ambiguous: frozenset[str] = frozenset()
    """Plain names that several bones share."""

    def main_owners(self) -> NDArray[np.int64]:
        """The bone that moves each vertex most, `(V,)`; -1 for a vertex that no bone moves."""
        most = self.weights.argmax(axis=1) if len(self.weights) else np.empty(0, np.int64)
        rows = np.arange(len(most))
        return np.where(self.weights[rows, most] > 0.0, self.owners[rows, most], -1)

    def children(self, bone: int) -> list[int]:
        """The bones that hang on a bone."""
        return [k for k, parent in enumerate(self.parents) if parent == bone]


def read_skeleton(path: Path) -> Skeleton:
    """Read a rig. Raises `RigFileError`."""
    suffix = path.suffix.lower()
    if suffix not in RIG_SUFFIXES:
        raise RigFileError(f"{path}: must end in {', '.join(RIG_SUFFIXES)}; export the avatar as glTF Binary (.glb)")
    try:
        return _from_bvh(path) if suffix == ".bvh" else _from_glb(path)
    except GlbError as error:
        raise RigFileError(f"{path}: {error}") from None
    except BvhError as error:
        raise RigFileError(str(error)) from None
    except OSError as error:
        raise RigFileError(f"{path}: cannot be read ({error.strerror or error})") from None


def _from_glb(path: Path) -> Skeleton:
    data = path.read_bytes()
    rig = read_glb_rig(data)
    skin = rig.vertices, rig.faces, rig.owners, rig.weights
    names, ambiguous = _told_apart(rig.names, [rig.humanoid, rig.joints, rig.bare])
    return Skeleton(names, rig.parents, rig.positions, {}, *skin, True, glb_chunks(data), ambiguous=ambiguous)


def _told_apart(names: list[str], likely: Sequence[frozenset[int]]) -> tuple[list[str], frozenset[str]]:
    """The names of the bones, and the plain names that several of them share.

    Of nodes that share one, the only one in the first of the sets `likely` that has any is the bone, and the number of
    the node is added to the names of the others.
    """
    sharing: dict[str, list[int]] = {}
    for n, name in enumerate(names):
        sharing.setdefault(plain(name), []).append(n)
    names, ambiguous = list(names), set()
    for name, nodes in sharing.items():
        kept = next((found for group in likely if (found := [n for n in nodes if n in group])), nodes)
        if len(kept) > 1:
            ambiguous.add(name)
        for n in set(nodes) - set(kept):
            names[n] = f"{names[n]} (node {n})"
    return names, frozenset(ambiguous)


def _from_bvh(path: Path) -> Skeleton:
    joints = read_bvh(path).joints
    heads = np.zeros((len(joints), 3))
    for k, joint in enumerate(joints):
        heads[k] = np.array(joint.offset) + (heads[joint.parent] if joint.parent >= 0 else 0.0)
    ends = {k: heads[k] + np.array(joint.end) for k, joint in enumerate(joints) if joint.end is not None}
    no_skin = np.empty((0, 3)), np.empty((0, 3), np.int64), np.empty((0, 4), np.int64), np.empty((0, 4))
    names, ambiguous = _told_apart([joint.name for joint in joints], [])
    if not np.isfinite(heads).all():
        joint = joints[int(np.argwhere(~np.isfinite(heads))[0, 0])]
        raise RigFileError(f"{path}: the offset of joint {joint.name!r} is not finite; export the file again")
    parents = [joint.parent for joint in joints]
    return Skeleton(names, parents, heads, ends, *no_skin, in_metres=False, joints=joints, ambiguous=ambiguous)
