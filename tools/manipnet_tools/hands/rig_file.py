"""Reads the skeleton of an avatar from a glTF Binary, VRM or BVH file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array
from manipnet.synthesis.objects.glb import glb_chunks, read_glb_rig
from manipnet.synthesis.objects.glb_accessors import GlbError
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

    def main_owners(self) -> NDArray[np.int64]:
        """The bone that moves each vertex most, `(V,)`."""
        most = self.weights.argmax(axis=1) if len(self.weights) else np.empty(0, np.int64)
        return self.owners[np.arange(len(most)), most]

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
    return Skeleton(rig.names, rig.parents, rig.positions, {}, *skin, in_metres=True, document=glb_chunks(data))


def _from_bvh(path: Path) -> Skeleton:
    joints = read_bvh(path).joints
    heads = np.zeros((len(joints), 3))
    for k, joint in enumerate(joints):
        heads[k] = np.array(joint.offset) + (heads[joint.parent] if joint.parent >= 0 else 0.0)
    ends = {k: heads[k] + np.array(joint.end) for k, joint in enumerate(joints) if joint.end is not None}
    no_skin = np.empty((0, 3)), np.empty((0, 3), np.int64), np.empty((0, 4), np.int64), np.empty((0, 4))
    names, parents = [joint.name for joint in joints], [joint.parent for joint in joints]
    return Skeleton(names, parents, heads, ends, *no_skin, in_metres=False, joints=joints)
