"""Reads TACO (Liu et al. 2024): two hands, a tool and a target, 30 frames a second.

Of its folders these are needed, as they are unpacked:

    Hand_Poses_3D/<triplet>/<sequence>/hand_joints.npy     (T, 2, 21, 3): left and right hand, metres
    Object_Poses/<triplet>/<sequence>/tool_<id>.npy        (T, 4, 4): from the object to the world, metres
    Object_Poses/<triplet>/<sequence>/target_<id>.npy
    Object_Models/<id>_cm.obj                              centimetres; also in object_models_released

The world has Z up. `Hand_Poses` holds parameters of MANO instead of joints and is not needed.
Source: github.com/leolyliu/TACO-Instructions.
"""

from pathlib import Path
from typing import Final

import numpy as np

from manipnet.geometry import Array, matrix_to_quat
from manipnet.synthesis.objects.mesh import ClosedMesh, load_mesh
from manipnet_tools.importing.source import JOINT_COUNT, ImportingError, Origin, SourceSet, SourceTake

ORIGIN: Final = Origin(
    "TACO",
    "CC BY 4.0",
    "Yun Liu, Haolin Yang, Xu Si, Ling Liu, Zipeng Li, Yuxiang Zhang, Yebin Liu and Li Yi",
    "https://taco2024.github.io",
)
RATE_HZ: Final = 30.0
FARTHEST_M: Final = 1e4
_JOINTS: Final = "hand_joints.npy"
_MODEL_FOLDERS: Final = ("Object_Models", "object_models_released", "Object_Models/object_models_released")
_Y_UP: Final = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def open_taco(folder: Path) -> SourceSet:
    """The sequences in a folder with the set. Raises `ImportingError`."""
    files = sorted((folder / "Hand_Poses_3D").glob(f"*/*/{_JOINTS}"))
    if not files:
        reason = "holds no Hand_Poses_3D/<triplet>/<sequence>/hand_joints.npy; unpack Hand_Poses_3D.zip of TACO there"
        if (folder / "Hand_Poses").is_dir():
            reason += "; Hand_Poses holds parameters of MANO, which require model files with a licence of their own"
        raise ImportingError(f"{folder}: {reason}")
    sequences = {f"{file.parts[-3]}/{file.parts[-2]}": file for file in files}
    return SourceSet(
        ORIGIN,
        tuple(sequences),
        lambda name: _read(name, sequences[name], folder / "Object_Poses" / name),
        lambda name: _mesh(name, folder),
    )


def _read(name: str, file: Path, objects: Path) -> SourceTake:
    joints = _array(file, (2, JOINT_COUNT, 3))
    poses = {
        f"taco_{path.stem.partition('_')[2]}": _array(path, (4, 4))
        for role in ("tool", "target")
        for path in sorted(objects.glob(f"{role}_*.npy"))
    }
    if not poses:
        raise ImportingError(f"{objects}: holds no tool_<id>.npy or target_<id>.npy; unpack Object_Poses.zip of TACO")
    frames = min(len(joints), *map(len, poses.values()))
    turned = joints[:frames] @ _Y_UP.T
    return SourceTake(
        name.rpartition("/")[2],
        RATE_HZ,
        {"left": turned[:, 0], "right": turned[:, 1]},
        {stem: _poses(matrices[:frames]) for stem, matrices in poses.items()},
    )


def _poses(matrices: Array) -> Array:
    """Poses `(T, 7)` with Y up from matrices `(T, 4, 4)` with Z up; NaN where a matrix is not a rigid pose."""
    rotations, places = _Y_UP @ matrices[:, :3, :3], matrices[:, :3, 3] @ _Y_UP.T
    right = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    with np.errstate(all="ignore"):
        right[right] = np.abs(np.linalg.det(rotations[right]) - 1.0) < 0.05
    poses = np.full((len(matrices), 7), np.nan)
    poses[right] = np.concatenate([places[right], matrix_to_quat(rotations[right])], axis=1)
    return poses


def _mesh(name: str, folder: Path) -> ClosedMesh:
    number = name.removeprefix("taco_")
    for place in _MODEL_FOLDERS:
        if (file := folder / place / f"{number}_cm.obj").is_file():
            return load_mesh(file, "cm", name=name)
    raise ImportingError(f"{folder}: holds no Object_Models/{number}_cm.obj; unpack Object_Models.zip of TACO there")


def _array(file: Path, shape: tuple[int, ...]) -> Array:
    """An array `(T, *shape)` in a file, with NaN for numbers that cannot be lengths. Raises `ImportingError`."""
    try:
        array = np.load(file, allow_pickle=False)
    except Exception as error:  # NumPy raises errors of any type for a damaged file
        raise ImportingError(f"{file}: cannot be read ({error}); copy it again") from None
    if array.shape[1:] != shape or not len(array) or array.dtype.kind != "f":
        expected = ", ".join(map(str, shape))
        raise ImportingError(f"{file}: holds {array.dtype} {array.shape}; expected are decimal numbers (T, {expected})")
    with np.errstate(invalid="ignore"):  # some kinds of NaN
        array = array.astype(np.float64)
    array[~(np.abs(array) < FARTHEST_M)] = np.nan
    return array
