"""Sets and glove takes that are imported for training, as inputs to damage: one file of each, beside good ones."""

import io
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from fuzz_files import FOLDER
from fuzz_takes import FileTarget
from other_joints import HAND, hand_joints, object_poses, times_s

from manipnet_tools.importing.bvh_takes import read_bvh_take
from manipnet_tools.importing.csv_takes import read_csv_take
from manipnet_tools.importing.dexterhand import open_dexterhand
from manipnet_tools.importing.source import ImportingError, SourceSet
from manipnet_tools.importing.taco import open_taco

_RATE_HZ = 30.0
_TIMES_S = times_s(0.1, _RATE_HZ)
_SESSION = "Cuboid_00-fps_30"


def _npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def _place(path: Path) -> Callable[[bytes], Path]:
    """Writes an input there; the other files around it are good ones."""
    path.parent.mkdir(parents=True, exist_ok=True)

    def place(data: bytes) -> Path:
        path.write_bytes(data)
        return path

    return place


def _read_all(open_set: Callable[[], SourceSet]) -> object:
    found = open_set()
    return [(found.read(name), [found.mesh(each) for each in found.read(name).objects]) for name in found.takes]


def _taco() -> tuple[Path, bytes, bytes]:
    """The folder of a set, its joints and the poses of its object."""
    folder = FOLDER / "taco"
    joints = np.stack([hand_joints(side, _TIMES_S) for side in ("left", "right")], axis=1)
    matrices = np.tile(np.eye(4), (len(joints), 1, 1))
    _place(folder / "Object_Models" / "051_cm.obj")(_BOX)
    return folder, _npy(joints.astype(np.float32)), _npy(matrices)


_BOX = b"""v 0 0 0
v 4 0 0
v 0 4 0
v 0 0 4
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""


def _session() -> bytes:
    poses, stream = object_poses("left", _TIMES_S), io.BytesIO()
    about = {"object_class": "Cuboid", "object_size": [0.15, 0.04, 0.05], "fps": 30, "index_init_frame": [0]}
    np.savez(
        stream,
        metadata=np.array(about, dtype=object),
        object_translations=poses[:, :3],
        object_orientations_quat_xyzw=poses[:, 3:],
    )
    return stream.getvalue()


def _hand_bvh(name: Callable[[str, int], str]) -> bytes:
    """A left hand with the names of another program."""
    joints = hand_joints("left", _TIMES_S)
    lines = ["HIERARCHY", f"ROOT {name('', 0)}", "{", "OFFSET 0 0 0", "CHANNELS 3 Xposition Yposition Zposition"]
    columns = [joints[:, 0]]
    for i, finger in enumerate(("thumb", "index", "middle", "ring", "pinky")):
        for place in range(3):
            lines += [f"JOINT {name(finger, place)}", "{", "OFFSET 1 2 3", "CHANNELS 3 Xposition Yposition Zposition"]
            at = 1 + 4 * i + place
            columns.append(joints[:, at] - joints[:, at - 1 if place else 0])
        lines += ["End Site", "{", "OFFSET 0 0 0", "}", "}", "}", "}"]
    lines += ["}", "MOTION", f"Frames: {len(joints)}", "Frame Time: 0.033333"]
    rows = np.concatenate(columns, axis=1)
    return "\n".join([*lines, *(" ".join(f"{v:.5f}" for v in row) for row in rows)]).encode() + b"\n"


def _glove_csv(separator: str = ",") -> bytes:
    joints, poses = hand_joints("right", _TIMES_S), object_poses("right", _TIMES_S)
    fingers = ("Thumb", "Index", "Middle", "Ring", "Pinky")
    names = ["RightWrist", *(f"Right{finger}{number}" for finger in fingers for number in range(1, 5))]
    head = ["time", *(f"{name}_{axis}" for name in names for axis in "xyz")]
    head += [f"Mug_{part}" for part in ("x", "y", "z", "qx", "qy", "qz", "qw")]
    rows = np.concatenate([_TIMES_S[:, None], joints.reshape(len(joints), -1), poses], axis=1)
    lines = [head, *([f"{value:.5f}" for value in row] for row in rows)]
    return "\n".join(separator.join(line) for line in lines).encode() + b"\n"


def _targets() -> dict[str, FileTarget]:
    taco, joints, matrices = _taco()
    hands = taco / "Hand_Poses_3D" / "cut" / "a" / "hand_joints.npy"
    tool = taco / "Object_Poses" / "cut" / "a" / "tool_051.npy"
    _place(hands)(joints)
    _place(tool)(matrices)
    other = FOLDER / "taco joints"
    _place(other / "Object_Poses" / "cut" / "a" / "tool_051.npy")(matrices)
    _place(other / "Object_Models" / "051_cm.obj")(_BOX)
    sessions, gloves = FOLDER / "dexterhand", FOLDER / "gloves"
    bvh = _hand_bvh(lambda finger, place: f"{finger}{place + 1}" if finger else "wrist")
    named = _hand_bvh(lambda finger, place: f"LeftHand{finger.title()}{place + 1}" if finger else "LeftHand")
    _place(sessions / "bvh" / f"{_SESSION}_hand.bvh")(bvh)
    place_joints = _place(other / "Hand_Poses_3D" / "cut" / "a" / "hand_joints.npy")
    return {
        "taco joints": FileTarget(
            lambda path: _read_all(partial(open_taco, other)), [joints], ImportingError, place_joints
        ),
        "taco poses": FileTarget(
            lambda path: _read_all(partial(open_taco, taco)), [matrices], ImportingError, _place(tool)
        ),
        "dexterhand": FileTarget(
            lambda path: _read_all(partial(open_dexterhand, sessions, HAND)),
            [_session()],
            ImportingError,
            _place(sessions / f"{_SESSION}.npz"),
        ),
        "glove bvh": FileTarget(
            lambda path: read_bvh_take("take", path.parent, HAND),
            [named, named.replace(b"LeftHand", b"Ann:LeftHand")],
            ImportingError,
            _place(gloves / "hand.bvh"),
        ),
        "glove csv": FileTarget(
            lambda path: read_csv_take("take", path, HAND),
            [_glove_csv(), _glove_csv(";")],
            ImportingError,
            _place(FOLDER / "glove.csv"),
        ),
    }


IMPORT_TARGETS = _targets()
