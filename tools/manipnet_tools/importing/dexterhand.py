"""Reads DexterHand (Liang et al. 2026): a left hand that manipulates one object, 20 or 60 frames a second.

A session `<object>_<number>-fps_<rate>.npz` holds the poses of the object and its size in metres. The hand is stored as
parameters of MANO. Turning them into joints requires the MANO model files, which have a licence of their own. With
those files, the authors' program writes the joints to `bvh/<session>_hand.bvh` beside the session:

    python -m Dataset.visualize_2bvh --data_path <session>.npz

That program replaces the first frame by a reference pose, so the first frame is left out. The shapes of the objects
are those of the authors' viewer: they are centred, and cylinders stand along y. Source: github.com/PKU-MoCCA/dextercap.
"""

import io
import zipfile
from pathlib import Path
from typing import Any, Final

import numpy as np
import trimesh

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.objects.mesh import ClosedMesh, closed_mesh
from manipnet_tools.importing.bvh_takes import hand_joints
from manipnet_tools.importing.plain_values import Named, plain_values
from manipnet_tools.importing.source import ImportingError, Origin, SourceSet, SourceTake
from manipnet_tools.importing.space import find_space
from manipnet_tools.takes.bvh_motion import BvhError, read_bvh

ORIGIN: Final = Origin(
    "DexterHand",
    "Apache-2.0",
    "Yutong Liang, Shiyi Xu, Yulong Zhang, Bowen Zhan, He Zhang and Libin Liu",
    "https://pku-mocca.github.io/Dextercap-Page",
)
LOST_M: Final = 900.0
"""An object that was not seen is at -1000 m; anything farther away than this counts as not seen."""
_NEEDED: Final = ("metadata", "object_translations", "object_orientations_quat_xyzw")


def open_dexterhand(folder: Path, hand: Hand) -> SourceSet:
    """The sessions in a folder. Raises `ImportingError`."""
    files = {file.stem: file for file in sorted(folder.glob("*.npz"))}
    if not files:
        raise ImportingError(f"{folder}: holds no sessions of DexterHand, such as Cuboid_00-fps_60.npz")
    return SourceSet(ORIGIN, tuple(files), lambda name: _read(files[name], hand), lambda name: _mesh(files[name]))


def _read(file: Path, hand: Hand) -> SourceTake:
    arrays, about = _session(file)
    if "RubiksCube" in file.stem:
        raise ImportingError(f"{file}: the object is not rigid, and takes can only have rigid objects")
    path = file.parent / "bvh" / f"{file.stem}_hand.bvh"
    if not path.is_file():
        raise ImportingError(
            f"{file}: holds parameters of MANO, not joints. Make {path} with the authors' program, which needs the "
            f"MANO model files and their licence: python -m Dataset.visualize_2bvh --data_path {file.name}"
        )
    try:
        motion = read_bvh(path)
    except BvhError as error:
        raise ImportingError(str(error)) from None
    joints = hand_joints(motion, str(path), "left")["left"]
    space = find_space({"left": joints[1:]}, hand)
    frames = min(len(joints), len(arrays["object_translations"]))
    places, turns = (np.asarray(arrays[name][1:frames], np.float64) for name in _NEEDED[1:])
    lost = (np.abs(places) > LOST_M).any(axis=1) | (np.linalg.norm(turns, axis=1) < 1e-6)
    norms = np.where(lost, 1.0, np.linalg.norm(turns, axis=1))[:, None]
    poses = np.where(lost[:, None], np.nan, np.concatenate([places, turns / norms], axis=1))
    if space.unit != "m" or space.mirrored:
        raise ImportingError(f"{path}: is not in metres like {file.name}; make it with the authors' program")
    rate_hz = about.get("fps", motion.rate_hz)
    return SourceTake(file.stem, float(rate_hz), {"left": joints[1:frames]}, {file.stem: poses})


def _session(file: Path) -> tuple[dict[str, Array], dict[str, Any]]:
    """The arrays and the metadata of a session. Raises `ImportingError`."""
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as data:
            if missing := [name for name in _NEEDED if name not in data]:
                raise ImportingError(f"{file}: is not a session of DexterHand; it holds no {missing[0]}")
            arrays = {name: data[name] for name in _NEEDED[1:]}
        with zipfile.ZipFile(file) as archive:
            about = _metadata(archive.read("metadata.npy"))
    except ImportingError:
        raise
    except Exception as error:  # NumPy raises errors of any type for a damaged file
        raise ImportingError(f"{file}: cannot be read ({error}); copy it again") from None
    if any(array.ndim != 2 or array.shape[1] != width for array, width in zip(arrays.values(), (3, 4), strict=True)):
        raise ImportingError(f"{file}: the poses of the object are not (T, 3) and (T, 4); copy it again")
    return arrays, about


def _metadata(content: bytes) -> dict[str, Any]:
    """The dictionary in an array file, which keeps it as a pickled array of one object."""
    stream = io.BytesIO(content)
    version = np.lib.format.read_magic(stream)
    (np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0)(stream)
    value = plain_values(stream.read())
    if isinstance(value, Named):  # the array, whose state ends with the list of its objects
        value = value.state[-1][0]
    if not isinstance(value, dict):
        raise ValueError("its metadata is not a dictionary")
    return value


def _mesh(file: Path) -> ClosedMesh:
    """The object of a session by its class and size: see `visualize.py` of the authors."""
    _, about = _session(file)
    kind = str(about.get("object_class", file.stem)).partition("_")[0]
    try:
        size = [float(value) for value in about["object_size"]]
        shape = _shape(kind, size)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise ImportingError(f"{file}: its object {kind!r} has no usable size ({error})") from None
    if shape is None:
        raise ImportingError(f"{file}: the shape of its object {kind!r} is unknown")
    return closed_mesh(shape.vertices, shape.faces, file.stem)


def _shape(kind: str, size: list[float]) -> trimesh.Trimesh | None:
    upright = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])  # z becomes y
    match kind:
        case "Cuboid":
            return trimesh.creation.box(size)
        case "Cylinder" | "Plate":
            shape = trimesh.creation.cylinder(radius=size[0] / 2, height=size[1], sections=96)
        case "Ring":
            shape = trimesh.creation.annulus(r_min=size[1] / 2, r_max=size[0] / 2, height=size[2], sections=96)
        case "Prism":
            turns = np.radians([210.0, 330.0, 90.0])
            corners = size[0] / 3.0**0.5 * np.stack([np.cos(turns), np.sin(turns)], axis=1)
            points = [(x, y, z) for y in (-size[1] / 2, size[1] / 2) for x, z in corners]
            return trimesh.Trimesh(
                points,
                [
                    *[(0, 1, 2), (3, 5, 4)],
                    *[t for a, b in ((0, 1), (1, 2), (2, 0)) for t in ((a, a + 3, b), (b, a + 3, b + 3))],
                ],
                process=False,
            )
        case _:
            return None
    return shape.apply_transform(upright)
