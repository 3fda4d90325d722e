"""Write the golden vectors: messages in both encodings, the values that a reader must find, and broken messages.

Run `python tests/vectors/make_vectors.py` after a change of the schema; a test fails while files and schema differ. All
numbers are exact binary fractions or normalised by one square root, so every machine writes the same bytes.
"""

import json
import math
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from manipnet.wire import BodyPose, HandPose, HandsMessage, Latency, encode_binary, encode_msgpack
from manipnet.wire.hands import BODY, HAND, HEADER, NAME, PREAMBLE

FOLDER = Path(__file__).parent


def floats(count: int, seed: int) -> np.ndarray:
    """Deterministic fractions in (-1, 1) without any symmetry between axes."""
    return np.array([((37 * i + 11 * seed + 5) % 127 - 63) / 64.0 for i in range(count)])


def quats(count: int, seed: int) -> np.ndarray:
    raw = floats(4 * count, seed).reshape(count, 4) + np.array([0.0, 0.0, 0.0, 1.5])
    lengths = [math.sqrt(sum(x * x for x in row)) for row in raw.tolist()]
    return as_f32(raw / np.array(lengths)[:, None])


def as_f32(values: np.ndarray) -> np.ndarray:
    """Round to 32 bits, as the binary encoding does, so that both encodings carry the same numbers."""
    return values.astype(np.float32).astype(np.float64)


def hand(seed: int, state: Any, name: str | None, scale: float = 1.0) -> HandPose:
    joints = np.hstack([floats(78, seed + 3).reshape(26, 3), quats(26, seed + 4)])
    rotations = quats(17, seed + 1)
    rotations[0] = [0.0, 0.0, 0.0, 1.0]
    return HandPose(state, name, scale, floats(20, seed), rotations, joints[1].copy(), joints)


def body(seed: int, name: str, tracked: bool = True) -> BodyPose:
    return BodyPose(tracked, np.hstack([floats(3, seed), quats(1, seed)[0]]), name)


def messages() -> dict[str, HandsMessage]:
    base = HandsMessage(
        session="3f2a",
        actor="actor",
        seq=7,
        t_capture=12.5,
        t_publish=1000.0625,
        look_ahead=0.5,
        hands={"left": hand(1, "live", "mug"), "right": hand(2, "live", "mug", 0.9375)},
        bodies=(body(5, "left_wrist"), body(6, "right_wrist"), body(7, "mug", tracked=False)),
        latency_ms=Latency(500.0, 2.5, 3.25, 0.5, 506.25),
    )
    long_name = "Würfel-" * 10  # 80 bytes: cut within the binary's 63 without splitting the ü
    return {
        "live": base,
        "hold_left_only": replace(base, seq=2**40 + 5, hands={"left": hand(3, "hold", "cube")}),
        "rest_no_object": replace(base, hands={s: hand(4, "rest", None) for s in ("left", "right")}, bodies=()),
        "right_first": replace(base, hands={"right": hand(8, "live", None), "left": hand(9, "hold", "ü")}),
        "many_bodies": replace(base, bodies=tuple(body(i, f"body {i}", i % 3 > 0) for i in range(40))),
        "no_hands": replace(base, session="", actor="演者", hands={}, bodies=(), look_ahead=0.0),
        "long_names": replace(base, session=long_name, bodies=(body(1, long_name),)),
        "timecode": replace(base, timecode="23:59:58;29", timecode_rate=29.96875),
    }


def expected(message: HandsMessage) -> dict[str, Any]:
    """A message as plain values, with names as the binary encoding carries them."""

    def name(text: str) -> str:
        return text.encode()[:63].decode(errors="ignore")

    return {
        "session": name(message.session),
        "actor": name(message.actor),
        "seq": message.seq,
        "t_capture": message.t_capture,
        "t_publish": message.t_publish,
        "look_ahead": message.look_ahead,
        "latency_ms": [getattr(message.latency_ms, f) for f in ("buffer", "sense", "infer", "ik", "total")],
        "hands": {
            side: {
                "state": h.state,
                "object": h.object,
                "scale": h.scale,
                "angles": h.angles.tolist(),
                "rotations": h.rotations.ravel().tolist(),
                "wrist": h.wrist.tolist(),
                "joints": h.joints.ravel().tolist(),
            }
            for side, h in message.hands.items()
        },
        "bodies": [{"name": name(b.name), "tracked": b.tracked, "pose": b.pose.tolist()} for b in message.bodies],
    }


def offset(record: np.dtype, field: str) -> int:
    """The byte offset of a field in a record."""
    fields: Any = record.fields
    return fields[field][1]


def longer_records(message: HandsMessage) -> bytes:
    """The message as a later writer of version 1 might send it, with more fields at the end of every record."""
    payload, out = encode_binary(message), bytearray()
    starts = [
        (HEADER.itemsize, 1, 8),
        (HAND.itemsize, len(message.hands), 16),
        (BODY.itemsize, len(message.bodies), 4),
    ]
    at = 0
    for size, count, extra in starts:
        for _ in range(count):
            out += payload[at : at + size] + b"\xa5" * extra
            at += size
    sizes = [HEADER.itemsize + 8, len(out), HAND.itemsize + 16, BODY.itemsize + 4]
    struct.pack_into("<HIHH", out, offset(PREAMBLE, "header_size"), *sizes)
    return bytes(out)


def broken(good: bytes) -> dict[str, bytes]:
    """Payloads that every reader must refuse, by what is wrong with them."""

    def patched(offset: int, data: bytes) -> bytes:
        return good[:offset] + data + good[offset + len(data) :]

    hand_at = HEADER.itemsize
    name_at = hand_at + offset(HAND, "object")
    return {
        "empty": b"",
        "truncated_header": good[:100],
        "truncated_body": good[:-1],
        "trailing_byte": good + b"\0",
        "magic": patched(0, b"MNPX"),
        "version_2": patched(offset(PREAMBLE, "version"), b"\x02\0"),
        "hand_size_small": patched(offset(PREAMBLE, "hand_size"), b"\x10\0"),
        "three_hands": patched(offset(PREAMBLE, "hand_count"), b"\x03\0"),
        "too_many_bodies": patched(offset(PREAMBLE, "body_count"), b"\x01\x01"),
        "side_2": patched(hand_at + offset(HAND, "side"), b"\x02"),
        "same_side_twice": patched(hand_at + offset(HAND, "side"), b"\x01"),
        "state_3": patched(hand_at + offset(HAND, "state"), b"\x03"),
        "nan_angle": patched(hand_at + offset(HAND, "angles"), struct.pack("<f", math.nan)),
        "infinite_joint": patched(hand_at + offset(HAND, "joints"), struct.pack("<f", math.inf)),
        "infinite_time": patched(offset(HEADER, "t_capture"), struct.pack("<d", -math.inf)),
        "name_length": patched(name_at, bytes([NAME.itemsize])),
        "name_not_utf8": patched(name_at, b"\x03\xff\xfe\xfd"),
    }


def files() -> dict[str, bytes]:
    """Every vector file by its name."""
    cases = messages()
    out = {f"{name}.bin": encode_binary(m) for name, m in cases.items()}
    out |= {f"{name}.msgpack": encode_msgpack(m) for name, m in cases.items()}
    out["longer_records.bin"] = longer_records(cases["live"])
    out |= {f"bad_{name}.bin": data for name, data in broken(out["live.bin"]).items()}
    values = {name: expected(m) for name, m in cases.items()}
    values["longer_records"] = values["live"]
    text = json.dumps(values, ensure_ascii=False, separators=(",", ":"))
    out["expected.json"] = text.replace('},"', '},\n"').encode() + b"\n"
    return out


if __name__ == "__main__":
    for file_name, data in files().items():
        (FOLDER / file_name).write_bytes(data)
