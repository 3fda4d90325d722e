"""Files to damage: rig files, recordings and model bundles. Their readers take a path, so every case is written."""

import atexit
import hashlib
import importlib.util
import io
import json
import shutil
import tempfile
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

from manipnet.recording.mcap_file import BODIES, RecordingWriter, read_about, read_bodies, read_hands
from manipnet.wire.bodies import parse_bodies

SHARED = Path("/dev/shm")
FOLDER = Path(tempfile.mkdtemp(prefix="manipnet-fuzz-", dir=SHARED if SHARED.is_dir() else None))
atexit.register(shutil.rmtree, FOLDER, ignore_errors=True)

RIG: dict[str, Any] = {
    "hand_scale": 0.9,
    "bodies": {"left_wrist": {"body": 1, "position": [0.0, 0.02, 0.0], "rotation": [0, 0, 0, 1]}, "right_wrist": "r"},
    "objects": [{"body": "Box", "mesh": "mesh.obj", "unit": "cm", "scale": 1.5, "name": "mug", "position": [0, 0, 1]}],
    "server": {"port": 0, "look_ahead": 0.1, "up": "z", "allow": ["10.0.0.0/8"], "natnet": "10.0.0.1:1510"},
}
ACTORS = {"actors": [{"name": name} | {k: RIG[k] for k in ("bodies", "objects")} for name in ("ann", "bob")]}


def place_rig(data: bytes) -> Path:
    """Write a rig file beside the mesh that it names; returns its path."""
    (FOLDER / "mesh.obj").touch()
    return _place(FOLDER / "rig.toml", data)


def place_recording(data: bytes) -> Path:
    """Write a recording; returns its path."""
    return _place(FOLDER / "recording.mcap", data)


def read_recording(path: Path) -> object:
    """Read everything that a recording holds."""
    return read_about(path), list(read_bodies(path)), list(read_hands(path))


def toml(document: dict[str, Any]) -> bytes:
    """A rig as TOML, in which everything below a table is in one line."""
    lines = [f"{_key(key)} = {_value(value)}" for key, value in document.items() if not isinstance(value, dict)]
    for name, table in document.items():
        if isinstance(table, dict):
            lines += [f"[{_key(name)}]", *(f"{_key(key)} = {_value(value)}" for key, value in table.items())]
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def recordings() -> list[bytes]:
    """A finished recording, one that ends early as after a kill, and one without compression and checksums."""
    body = {"name": "left_wrist", "p": [0.1, 1.0, 0.0], "q": [0.0, 0.0, 0.0, 1.0], "tracked": True}
    frames = [parse_bodies(json.dumps({"t": t, "bodies": [body]}).encode(), t, "fuzz") for t in (0.0, 0.01)]
    path = FOLDER / "good.mcap"
    with RecordingWriter(path, {"model": "tiny"}, {"mesh.obj": b"v 0 0 0"}) as writer:
        for number, frame in enumerate(frames):
            writer.write_bodies(frame, number * 10_000_000)
    whole = path.read_bytes()
    stream = io.BytesIO()
    bare = Writer(stream, compression=CompressionType.NONE, enable_crcs=False, enable_data_crcs=False)
    bare.start()
    channel = bare.register_channel(BODIES, "json", 0)
    for number in range(2):
        bare.add_message(channel, number, json.dumps({"t": number, "bodies": [body]}).encode(), number)
    bare.finish()
    return [whole, whole[: 2 * len(whole) // 3], stream.getvalue()]


class Bundles:
    """Writes bundles with another `bundle.json` or another graph. Needs onnx."""

    def __init__(self) -> None:
        from tiny_bundle import write_tiny_bundle

        self._folder = write_tiny_bundle(FOLDER / "tiny")
        self.meta = (self._folder / "bundle.json").read_bytes()
        self.graph = (self._folder / "manipnet.onnx").read_bytes()

    def place_meta(self, data: bytes) -> Path:
        """Write a bundle with this `bundle.json`; returns its folder."""
        _place(self._folder / "manipnet.onnx", self.graph)
        return _place(self._folder / "bundle.json", data).parent

    def place_graph(self, data: bytes) -> Path:
        """Write a bundle with this graph and its hash; returns its folder."""
        meta = json.loads(self.meta) | {"model_sha256": hashlib.sha256(data).hexdigest()}
        _place(self._folder / "bundle.json", json.dumps(meta).encode())
        return _place(self._folder / "manipnet.onnx", data).parent


def _place(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def bundles() -> Bundles | None:
    """The writer of bundles, or None if onnx is not installed."""
    return Bundles() if importlib.util.find_spec("onnx") else None


def _key(key: str) -> str:
    return json.dumps(key)


def _value(value: Any) -> str:
    match value:
        case dict():
            return "{" + ", ".join(f"{_key(key)} = {_value(entry)}" for key, entry in value.items()) + "}"
        case list():
            return "[" + ", ".join(map(_value, value)) + "]"
        case float():
            return repr(value)
        case None:
            return '""'
    return json.dumps(value)
