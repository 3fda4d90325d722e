"""Generated takes on disk: `takes/<take>/take.npz` beside `meshes` and `hands` of the same folder (`docs/generate.md`).

A take has both hands as poses of the wrists and angles of the hinges, and one object. Arrays are float32, in the
project frame; a left hand's angles are those of its mirror image, as everywhere.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from manipnet.common.atomic_file import replacing
from manipnet.geometry import SIDES, Array, Side
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.hand_file import read_hand
from manipnet.synthesis.hand.validation import HandError
from manipnet_tools.takes.dataset import TAKE_FILE

FORMAT: Final = 1


class TakeFileError(ValueError):
    """A generated take cannot be read; the text names the file and what is wrong."""


@dataclass(frozen=True, eq=False)
class GeneratedTake:
    """T frames of two hands and an object."""

    rate_hz: float
    hand_name: str
    object_name: str
    object: Array
    """`(T, 7)` in the world."""
    wrists: dict[Side, Array]
    """`(T, 7)` each, in the world."""
    angles: dict[Side, Array]
    """`(T, A)` each, radians."""
    notes: dict[str, Any]
    """What was made: the kind of the shape, the grasps with their sides and times, and counts."""


def write_take_file(take: GeneratedTake, folder: Path) -> None:
    """Write a take into its folder."""
    folder.mkdir(parents=True, exist_ok=True)
    arrays: dict[str, Any] = {
        "format": np.array(FORMAT),
        "rate_hz": np.array(take.rate_hz),
        "hand": np.array(take.hand_name),
        "object": np.array(take.object_name),
        "T_world_object": take.object.astype(np.float32),
        "notes": np.array(json.dumps(take.notes)),
    }
    for side in SIDES:
        arrays[f"T_world_{side}_wrist"] = take.wrists[side].astype(np.float32)
        arrays[f"{side}_angles"] = take.angles[side].astype(np.float32)
    with replacing(folder / TAKE_FILE) as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def read_take_file(folder: Path) -> tuple[GeneratedTake, Hand]:
    """A take and the hand that it is of. Raises `TakeFileError`."""
    path = folder / TAKE_FILE
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as content:
            arrays = dict(content)
        if int(arrays["format"]) != FORMAT:
            raise TakeFileError(f"{path}: is a take of format {int(arrays['format'])}; this version reads {FORMAT}")
        take = GeneratedTake(
            float(arrays["rate_hz"]),
            str(arrays["hand"]),
            str(arrays["object"]),
            _poses(arrays["T_world_object"]),
            {side: _poses(arrays[f"T_world_{side}_wrist"]) for side in SIDES},
            {side: arrays[f"{side}_angles"].astype(np.float64) for side in SIDES},
            json.loads(str(arrays["notes"])),
        )
        return take, read_hand(folder.parent.parent / "hands" / f"{take.hand_name}.npz")
    except TakeFileError:
        raise
    except HandError as error:
        raise TakeFileError(f"{path}: its hand is missing or damaged: {error}") from None
    except Exception as error:  # numpy, zipfile and zlib each raise their own for a damaged file
        raise TakeFileError(f"{path}: is not a generated take ({error})") from None


def _poses(poses: Array) -> Array:
    poses = poses.astype(np.float64)
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    return poses
