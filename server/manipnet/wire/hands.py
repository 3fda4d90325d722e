"""The hands message, declared once.

The dataclasses below are the schema. The type of each field includes its type in the binary record, so the layout in
`docs/protocol.md` and the constants of the readers in other languages follow from them.
Right-handed, Y up, metres, seconds, radians, quaternions xyzw.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Final, Literal, get_args, get_type_hints

import numpy as np

from manipnet.geometry import Array, Side
from manipnet.wire.hand_names import ANGLE_NAMES, BONE_NAMES, OPENXR_JOINT_NAMES

VERSION: Final = 1
MAGIC: Final = b"MNPL"
TOPIC_MSGPACK: Final = b"pose/msgpack "
TOPIC_BIN: Final = b"pose/bin "


def hand_topics(name: str) -> tuple[bytes, bytes]:
    """The topics of the hands of a profile, in msgpack and binary."""
    return f"hand/{name}/msgpack ".encode(), f"hand/{name}/bin ".encode()


MAX_PAYLOAD_BYTES: Final = 131_072
NAME_BYTES: Final = 63
"""The longest name in the binary encoding, in bytes of UTF-8. Names in msgpack may have any length."""

State = Literal["live", "hold", "rest"]
STATES: Final[tuple[State, ...]] = get_args(State)

NAME: Final = np.dtype([("length", "u1"), ("text", "u1", (NAME_BYTES,))])
Name = Annotated[str, NAME]
Float = Annotated[float, np.dtype("<f4")]
Double = Annotated[float, np.dtype("<f8")]
Pose = Annotated[Array, np.dtype(("<f4", (7,)))]


@dataclass(frozen=True, slots=True, eq=False)
class HandPose:
    """One hand at one instant.

    `angles (20,)` are in the order of `hand_names.ANGLE_NAMES`. `rotations (17, 4)` are local to the parent bone, with
    the identity for the wrist, and mirrored (S R S) for a left hand. `wrist (7,)` and `joints (26, 7)`, in OpenXR
    order, are world poses.
    """

    state: Annotated[State, np.dtype("u1")]
    object: Annotated[str | None, NAME]
    scale: Float
    angles: Annotated[Array, np.dtype(("<f4", (len(ANGLE_NAMES),)))]
    rotations: Annotated[Array, np.dtype(("<f4", (len(BONE_NAMES), 4)))]
    wrist: Pose
    joints: Annotated[Array, np.dtype(("<f4", (len(OPENXR_JOINT_NAMES), 7)))]
    wrist_shift: Array | None = None
    """`(3,)` how far the wrist of an avatar's hand is moved from where it is tracked, in the world, metres."""


@dataclass(frozen=True, slots=True, eq=False)
class BodyPose:
    """A tracked body at the synthesised instant: `pose (7,)` in the world."""

    tracked: Annotated[bool, np.dtype("u1")]
    pose: Pose
    name: Name


@dataclass(frozen=True, slots=True)
class Latency:
    """The delay of each stage, in milliseconds."""

    buffer: Float = 0.0
    sense: Float = 0.0
    infer: Float = 0.0
    ik: Float = 0.0
    total: Float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class HandsMessage:
    """The hands of one actor at one instant.

    `t_capture` is the synthesised instant on the sender's clock, and `t_publish` the time of sending on the server's
    monotonic clock. `seq` rises by one with each message of an actor.
    """

    session: Name
    actor: Name
    seq: Annotated[int, np.dtype("<u8")]
    t_capture: Double
    t_publish: Double
    look_ahead: Double
    hands: Mapping[Side, HandPose]
    bodies: tuple[BodyPose, ...] = ()
    latency_ms: Latency = Latency()
    v: int = VERSION
    timecode: str | None = None
    """SMPTE timecode HH:MM:SS:FF of the instant (";" before FF for drop frame), if the tracker sends one."""
    timecode_rate: float | None = None
    """The timecode's frames per second, if it is known."""
    hand: str | None = None
    """The name of the hand profile that the hands are of; None for the model's hand."""
    numbers: Array | None = field(default=None, init=False)
    """All its numbers (`wire.numbers`), if whoever made it knows that they are sound. A changed copy has none."""

    def with_sound(self, numbers: Array) -> "HandsMessage":
        """The same message, with its numbers, which are known to be sound."""
        object.__setattr__(self, "numbers", numbers)
        return self


Record = list[tuple[str, np.dtype]]


def _record(cls: type) -> Record:
    """The fields of a dataclass that are part of its binary record, in order."""
    hints = get_type_hints(cls, include_extras=True)
    named = ((f.name, getattr(hints[f.name], "__metadata__", ())) for f in fields(cls))
    return [(name, metadata[0]) for name, metadata in named if metadata]


RECORDS: Final = {cls: _record(cls) for cls in (HandsMessage, HandPose, BodyPose, Latency)}

PREAMBLE: Final = np.dtype(
    [
        ("magic", "S4"),
        ("version", "<u2"),
        ("header_size", "<u2"),
        ("total_size", "<u4"),
        ("hand_size", "<u2"),
        ("body_size", "<u2"),
        ("hand_count", "<u2"),
        ("body_count", "<u2"),
    ]
)
"""The beginning of every binary message, in all versions."""

LATENCY: Final = np.dtype(RECORDS[Latency])
HEADER: Final = np.dtype([*PREAMBLE.descr, *RECORDS[HandsMessage], ("latency_ms", LATENCY)], align=True)
_TIMECODE: Final = np.dtype([("timecode", NAME), ("timecode_rate", "<f4"), ("reserved", "V4")])
TIMED_HEADER: Final = np.dtype(
    {
        "names": [*(HEADER.names or ()), *(_TIMECODE.names or ())],
        "formats": [kind for part in (HEADER, _TIMECODE) for kind, *_ in (part.fields or {}).values()],
        "offsets": [
            start + offset
            for start, part in ((0, HEADER), (HEADER.itemsize, _TIMECODE))
            for _, offset, *_ in (part.fields or {}).values()
        ],
        "itemsize": HEADER.itemsize + _TIMECODE.itemsize,
    }
)
"""The header of a message that has a timecode. A rate of zero means that it is not known."""
HAND: Final = np.dtype([("side", "u1"), ("has_object", "u1"), *RECORDS[HandPose]], align=True)
BODY: Final = np.dtype(RECORDS[BodyPose], align=True)
