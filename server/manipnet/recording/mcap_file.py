"""Recordings: MCAP files with what was tracked, what was synthesised, and what both depended on.

| topic | payload |
|---|---|
| `/bodies` | the body message of `docs/protocol-in.md`, JSON |
| `/hands` | the hands message of `docs/protocol.md`, msgpack |
| `hand/NAME` | the same message of an avatar, without bodies, which `/hands` has |
| `/tf` | Foxglove's FrameTransforms, JSON: bodies and OpenXR joints in the frame `world` |

Log times are this machine's clock at the arrival, in nanoseconds; the messages hold the sender's clock. The meshes are
attachments, and the rig and the hash of the model are metadata; both come before the first message. The profile of an
avatar that joins later is metadata before the first message of its topic. Chunks are small
and are handed to the operating system at once, so a process that is killed loses a fraction of a second. No reader here
needs the end of a file. Sources: mcap.dev/spec; docs.foxglove.dev, "Message schemas", FrameTransforms.
"""

import json
import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import Writer
from numpy.typing import NDArray

from manipnet.geometry import Array
from manipnet.synthesis.objects.ply import ply_file
from manipnet.wire import HandsMessage, decode_msgpack, encode_msgpack
from manipnet.wire.bodies import BodyFrame, BodySample, MessageError, bodies_map, parse_bodies
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES

BODIES: Final = "/bodies"
HANDS: Final = "/hands"
TF: Final = "/tf"
AVATAR: Final = "hand/"
"""The topic of an avatar begins with this; the name of its profile follows."""
ABOUT: Final = "manipnet"
"""Name of the metadata records, which hold model, model_hash, rig and everything else that the writer knew."""
FLUSH_NS: Final = 250_000_000
"""A killed process loses at most this much, by the clock of the log times."""
MAX_RECORD_BYTES: Final = 1 << 28


def _record(title: str | None, **properties: dict[str, Any]) -> dict[str, Any]:
    """JSON schema of an object with all of these properties."""
    named = {"title": title} if title else {}
    return named | {"type": "object", "properties": properties, "required": list(properties)}


_NUMBERS = {"type": "array", "items": {"type": "number"}}
_NUMBER = {"type": "number"}
_TEXT = {"type": "string"}
_SECONDS = {"type": "integer", "minimum": 0}
_BODY = {"id": {"type": "integer"}, "name": {"type": "string"}, "p": _NUMBERS, "q": _NUMBERS}
_BODY_ITEM = {"type": "object", "properties": _BODY | {"tracked": {"type": "boolean"}}}
_TRANSFORM = _record(
    "foxglove.FrameTransform",
    timestamp={
        "type": "object",
        "title": "time",
        "properties": {"sec": _SECONDS, "nsec": _SECONDS | {"maximum": 999_999_999}},
    },
    parent_frame_id=_TEXT,
    child_frame_id=_TEXT,
    translation=_record("foxglove.Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER),
    rotation=_record("foxglove.Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER),
)
_SCHEMAS: Final[dict[str, dict[str, Any]]] = {
    BODIES: _record(
        "manipnet.Bodies",
        t=_NUMBER,
        frame={"type": ["integer", "null"]},
        bodies={"type": "array", "items": _BODY_ITEM},
    ),
    TF: _record("foxglove.FrameTransforms", transforms={"type": "array", "items": _TRANSFORM}),
}
"""JSON schemas of the topics in JSON. Foxglove recognises its own schemas by their titles."""

_log = logging.getLogger(__name__)


class RecordingError(ValueError):
    """A recording that cannot be used; the text names the file, what is wrong, and what to do."""


class RecordingWriter:
    """Writes one recording. Not thread-safe."""

    def __init__(self, path: Path, about: Mapping[str, str], meshes: Mapping[str, bytes] | None = None) -> None:
        """Create the file `path`. Raises `FileExistsError` if it exists, and other kinds of `OSError`.

        `about` becomes the metadata. `meshes` are mesh files, as `mesh_file` makes them, by their file names, whose
        stems are the names of the props.
        """
        self._file = path.open("xb")
        self._writer = Writer(self._file)
        self._writer.start(profile="manipnet", library="manipnet-live")
        self._writer.add_metadata(ABOUT, dict(about))
        for name, content in (meshes or {}).items():
            self._writer.add_attachment(0, 0, name, f"model/{Path(name).suffix[1:]}", content)
        self._channels = {BODIES: self._channel(BODIES), TF: self._channel(TF)}
        self._channels[HANDS] = self._writer.register_channel(HANDS, "msgpack", 0)
        self._counts = dict.fromkeys(self._channels, 0)
        self._flushed_ns = 0

    def write_bodies(self, frame: BodyFrame, now_ns: int) -> None:
        """Write a frame that arrived at `now_ns`, by `time.time_ns()`; a generated recording may use any clock."""
        self._add(BODIES, json.dumps(bodies_map(frame), separators=(",", ":")).encode(), now_ns)
        poses = [(body.name or str(body.id), (*body.p, *body.q)) for body in frame.bodies if body.tracked]
        self._add(TF, _transforms(poses, now_ns), now_ns)

    def add_about(self, about: Mapping[str, str]) -> None:
        """Write metadata that became known after the beginning."""
        self._writer.add_metadata(ABOUT, dict(about))

    def write_hands(self, message: HandsMessage, now_ns: int) -> None:
        """Write a message that was published at `now_ns`. Raises `MessageError` for numbers that are not finite."""
        actor = message.actor
        if message.hand is not None:
            message, actor = replace(message, bodies=()), f"{actor}/{message.hand}"
        self._add(HANDS if message.hand is None else AVATAR + message.hand, encode_msgpack(message), now_ns)
        poses = [
            (f"{actor}/{side}/{joint}", pose)
            for side, hand in message.hands.items()
            for joint, pose in zip(OPENXR_JOINT_NAMES, hand.joints.tolist(), strict=True)
        ]
        poses += [(f"{actor}/{body.name}", body.pose.tolist()) for body in message.bodies if body.tracked]
        self._add(TF, _transforms(poses, now_ns), now_ns)

    @property
    def counts(self) -> Mapping[str, int]:
        """The number of messages so far, by topic."""
        return self._counts

    def close(self) -> None:
        """Finish the file; a second call does nothing."""
        if not self._file.closed:
            self._writer.finish()
            self._file.close()

    def __enter__(self) -> "RecordingWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _channel(self, topic: str) -> int:
        schema = _SCHEMAS[topic]
        id = self._writer.register_schema(schema["title"], "jsonschema", json.dumps(schema).encode())
        return self._writer.register_channel(topic, "json", id)

    def _add(self, topic: str, payload: bytes, now_ns: int) -> None:
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, "msgpack", 0)
            self._counts[topic] = 0
        self._writer.add_message(self._channels[topic], now_ns, payload, now_ns, self._counts[topic])
        self._counts[topic] += 1
        if now_ns - self._flushed_ns >= FLUSH_NS:
            self._writer.flush()
            self._flushed_ns = now_ns


@dataclass(frozen=True)
class About:
    """What a recording depended on: metadata, and mesh files by name. `whole` if it was closed and is undamaged."""

    metadata: Mapping[str, str]
    meshes: Mapping[str, bytes]
    counts: Mapping[str, int]
    """The number of messages by topic."""
    whole: bool


def mesh_file(vertices: Array, faces: NDArray[np.integer[Any]], scale: float = 1.0) -> bytes:
    """A mesh as a recording keeps it: a PLY file in metres, at the size it had on the stage."""
    return ply_file(scale * vertices, faces)


def bodies_of(message: HandsMessage) -> BodyFrame:
    """The bodies of a hands message as the frame that a tracker would have sent at that instant."""
    bodies = [
        BodySample(None, body.name, tuple(body.pose[:3].tolist()), tuple(body.pose[3:].tolist()), body.tracked)
        for body in message.bodies
    ]
    timecode = message.timecode, message.timecode_rate
    return BodyFrame(message.t_capture, message.seq, tuple(bodies), message.t_publish, "hands", *timecode)


def read_about(path: Path | str) -> About:
    """Read everything except the messages. Raises `RecordingError` for a file that is not a recording."""
    scan = _Scan(Path(path))
    metadata: dict[str, str] = {}
    meshes, counts = {}, {}
    for record in scan.records():
        if isinstance(record, Metadata) and record.name == ABOUT:
            metadata |= record.metadata
        elif isinstance(record, Attachment):
            meshes[Path(record.name).name] = record.data
        elif isinstance(record, Message):
            topic = scan.topics[record.channel_id]
            counts[topic] = counts.get(topic, 0) + 1
    return About(metadata, meshes, counts, scan.whole)


def read_messages(path: Path | str, *topics: str) -> Iterator[tuple[str, int, bytes]]:
    """Topic, log time in nanoseconds and payload of the messages of `topics`, in the order of writing.

    Damaged parts are left out, with a warning. Raises `RecordingError` for a file that is not a recording.
    """
    scan = _Scan(Path(path))
    for record in scan.records():
        if isinstance(record, Message) and (topic := scan.topics[record.channel_id]) in topics:
            yield topic, record.log_time, record.data
    if not scan.whole:
        _log.warning("%s is cut off or damaged; the undamaged parts were read", path)


def read_bodies(path: Path | str) -> Iterator[BodyFrame]:
    """The body frames of a recording, in order; `t_received_s` is the log time. Raises `RecordingError`."""
    source = f"recording:{Path(path).name}"
    for _, time_ns, payload in read_messages(path, BODIES):
        try:
            yield parse_bodies(payload, time_ns * 1e-9, source)
        except MessageError as error:
            raise RecordingError(f"{path}: a message of {BODIES} is not a valid body message: {error}") from None


def read_hands(path: Path | str, avatar: str | None = None) -> Iterator[HandsMessage]:
    """The hands messages of a recording, in order: of the model's hands, or of an avatar's. Raises `RecordingError`."""
    wanted = HANDS if avatar is None else AVATAR + avatar
    for topic, _, payload in read_messages(path, wanted):
        try:
            yield decode_msgpack(payload)
        except MessageError as error:
            raise RecordingError(f"{path}: a message of {topic} is not a valid hands message: {error}") from None


def recorded_avatars(about: About) -> list[str]:
    """The names of the avatars whose hands a recording has."""
    return [topic.removeprefix(AVATAR) for topic in about.counts if topic.startswith(AVATAR)]


def recover(path: Path | str, out: Path) -> About:
    """Write everything that can be read of `path` to the new file `out`; returns what was read.

    Raises `RecordingError` if no message can be read and `FileExistsError` if `out` exists.
    """
    about = read_about(path)
    if not about.counts:
        raise RecordingError(f"{path}: no message can be read, so nothing can be recovered")
    with RecordingWriter(out, about.metadata, about.meshes) as writer:
        avatars = (AVATAR + name for name in recorded_avatars(about))
        for topic, time_ns, payload in read_messages(path, BODIES, HANDS, TF, *avatars):
            writer._add(topic, payload, time_ns)
    return about


class _Scan:
    """One pass over a file that may be cut off anywhere."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.topics: dict[int, str] = {}
        self.whole = False

    def records(self) -> Iterator[McapRecord]:
        """Records in order, including those in chunks; `whole` is set after the last one."""
        damaged = False
        try:
            with self._path.open("rb") as file:
                for record in StreamReader(file, emit_chunks=True, record_size_limit=MAX_RECORD_BYTES).records:
                    inside = _unpack(record) if isinstance(record, Chunk) else [record]
                    damaged = damaged or inside is None
                    for each in inside or ():
                        if isinstance(each, Channel):
                            self.topics[each.id] = each.topic
                        if not isinstance(each, Message) or each.channel_id in self.topics:
                            yield each
            self.whole = not damaged
        except OSError as error:
            raise RecordingError(f"{self._path}: cannot be read ({error.strerror})") from None
        except Exception as error:  # the reader raises errors of any type for a file that is cut off
            if not self.topics:
                raise RecordingError(f"{self._path}: not a recording, or cut off before its first message") from error


def _unpack(chunk: Chunk) -> Sequence[McapRecord] | None:
    """The records of a chunk; None if it is damaged."""
    try:
        return breakup_chunk(chunk, validate_crc=True)
    except Exception:  # decompression and parsing raise errors of any type
        return None


def _transforms(poses: Sequence[tuple[str, Sequence[float] | Array]], now_ns: int) -> bytes:
    """FrameTransforms of world poses `(7,)` by frame name."""
    stamp = {"sec": now_ns // 1_000_000_000, "nsec": now_ns % 1_000_000_000}
    transforms = [
        {
            "timestamp": stamp,
            "parent_frame_id": "world",
            "child_frame_id": name,
            "translation": dict(zip("xyz", (round(float(v), 6) for v in pose[:3]), strict=True)),
            "rotation": dict(zip("xyzw", (round(float(v), 6) for v in pose[3:]), strict=True)),
        }
        for name, pose in poses
    ]
    return json.dumps({"transforms": transforms}, separators=(",", ":")).encode()
