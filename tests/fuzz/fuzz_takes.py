"""Files of other programs as inputs to damage: takes, meshes and sets that are imported."""

import pickle
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fuzz_files import FOLDER
from glb_writer import Glb, box, box_glb

from manipnet.synthesis.objects.glb import read_glb
from manipnet.synthesis.objects.glb_accessors import GlbError
from manipnet_tools.importing.plain_values import plain_values
from manipnet_tools.takes.bvh_motion import BvhError, read_bvh
from manipnet_tools.takes.motive_csv import read_motive_csv
from manipnet_tools.takes.motive_table import MotiveCsvError


@dataclass(frozen=True)
class FileTarget:
    """The arguments of a `Target`."""

    read: Callable
    good: list[bytes]
    error: type[Exception]
    place: Callable = lambda data: data


def _place(name: str) -> Callable[[bytes], Path]:
    def place(data: bytes) -> Path:
        path = FOLDER / name
        path.write_bytes(data)
        return path

    return place


def _bvh(offset: str = "0 1 0") -> bytes:
    joint = f"{{\nOFFSET {offset}\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
    inner = f"JOINT Bip01 a\n{{\nOFFSET {offset}\nCHANNELS 1 Zrotation\nEnd Site\n{{\nOFFSET 0 0 1\n}}\n}}\n}}\n"
    rows = "\n".join(f"{k} 1 2 3 4 5 6" for k in range(4))
    return f"HIERARCHY\nROOT hip\n{joint}{inner}MOTION\nFrames: 4\nFrame Time: 0.008333\n{rows}\n".encode()


def _csv(separator: str = ",", labels: bool = True) -> bytes:
    word = (lambda text: text) if labels else (lambda text: "")
    first = "Format Version,1.23,Export Frame Rate,120.000000,Rotation Type,Quaternion,Length Units,Meters"
    parts = ["Rotation"] * 4 + ["Position"] * 3
    rows = [["", word("Type"), *["Rigid Body"] * 7], ["", word("Name"), *["Box"] * 7], ["", word("ID"), *["A"] * 7]]
    rows += [["", "", *parts], ["Frame", "Time", *"XYZWXYZ"]]
    rows += [[str(k), f"{k / 120:.6f}", "0.0", "0.0", "0.0", "1.0", "0.5", "1.0", "-0.25"] for k in range(4)]
    lines = [first, "", *(",".join(row) for row in rows)]
    return "\n".join(lines).replace(",", separator).encode() + b"\n"


def _glbs() -> list[bytes]:
    sparse = box_glb(box(0.1, 0.1, 0.1))
    where, what = sparse.view(b"\1\0"), sparse.view(bytes(12))
    sparse.document["accessors"][0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": where, "componentType": 5123},
        "values": {"bufferView": what},
    }
    copies: Glb = box_glb(box(1, 1, 1), "i2", normalized=True)
    place = copies.array(box(1, 1, 1))
    copies.document["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": place}}}
    apart = box_glb(box(0.1, 0.1, 0.1), stride=24)
    strip = box_glb(box(0.1, 0.1, 0.1))
    strip.primitive["mode"] = 5
    unit = box_glb(box(1, 1, 1), "u2", normalized=True)
    unit.document["extensionsRequired"] = unit.document["extensionsUsed"] = ["KHR_mesh_quantization"]
    unit.document["nodes"][0]["rotation"] = [0.0, 0.6, 0.0, 0.8]
    return [each.bytes() for each in (box_glb(box(0.1, 0.1, 0.1)), sparse, copies, apart, strip, unit)]


def _first_motive() -> bytes:
    """The list of frames of Motive 1.0 and Tracking Tools."""
    frames = [f"frame,{k},{k / 120:.6f},1,7,{'0.5,' * 6}1.0,0,0,0" for k in range(4)]
    return (
        "\n".join(["comment,made up", "righthanded", "info,version,1.1", "rigidbody,Box,7,4", *frames]).encode() + b"\n"
    )


_PICKLES = [pickle.dumps({"fps": 20, "size": [0.1, 2.5, None]}, protocol) for protocol in range(6)]

_MOTIVE = [
    _csv(),
    _csv(";"),
    _csv("\t"),
    _csv(labels=False),
    _csv().decode().encode("utf-16"),
    _csv().replace(b"Rigid Body", b"Bone").replace(b"Box", b"Ann:LHand"),
    _csv().replace(b"1.23", b"1.25").replace(b"Meters", b"Millimeters"),
    _first_motive(),
]
FILE_TARGETS = {
    "bvh": FileTarget(read_bvh, [_bvh(), b"\xef\xbb\xbf" + _bvh("1e-3 0 0")], BvhError, _place("take.bvh")),
    "motive": FileTarget(read_motive_csv, _MOTIVE, MotiveCsvError, _place("take.csv")),
    "glb": FileTarget(read_glb, _glbs(), GlbError),
    "pickle": FileTarget(plain_values, _PICKLES, ValueError),
}
