"""Writes NatNet packets for tests, field by field from the description of the protocol, independently of the reader."""

import struct
from dataclasses import dataclass, field


@dataclass
class Body:
    id: int
    p: tuple = (0.1, 0.2, 0.3)
    q: tuple = (0.0, 0.0, 0.0, 1.0)
    error: float = 0.001
    params: int = 1

    def write(self):
        return struct.pack("<i3f4ffh", self.id, *self.p, *self.q, self.error, self.params)


@dataclass
class Frame:
    """A frame with something in every section, so that each section must be skipped correctly."""

    number: int = 7
    bodies: list = field(default_factory=lambda: [Body(1), Body(2, params=0)])
    timestamp_s: float = 12.5
    stamps: tuple = (1_000, 2_000, 3_000)
    flags: int = 4
    full: bool = True
    tail: bytes = b"\0\0\0\0"

    def write(self, version):
        def section(elements):
            data = b"".join(elements)
            size = struct.pack("<i", len(data)) if version >= (4, 1) else b""
            return struct.pack("<i", len(elements)) + size + data

        some = self.full
        vector = struct.pack("<3f", 1, 2, 3)
        marker_sets = [b"Box\0" + struct.pack("<i", 2) + 2 * vector, b"all\0" + struct.pack("<i", 0)]
        skeleton = struct.pack("<ii", 9, 3) + b"".join(Body(n).write() for n in range(3))
        asset = struct.pack("<ii", 5, 1) + Body(1).write() + struct.pack("<i", 1) + bytes(26)
        labelled = struct.pack("<i3ffhf", 0x20001, 1, 2, 3, 0.01, 2, 0.0005)
        plate = struct.pack("<iiififf", 1, 2, 1, 0.5, 2, 0.5, 0.25)
        parts = [
            struct.pack("<i", self.number),
            section(marker_sets if some else []),
            section([vector] * 5 if some else []),
            section([body.write() for body in self.bodies]),
            section([skeleton] if some else []),
        ]
        if version >= (4, 1):
            parts.append(section([asset] if some else []))
        parts += [
            section([labelled] * 6 if some else []),
            section([plate] if some else []),
            section([plate, plate] if some else []),
            struct.pack("<IId3Q", 0x01020304, 5, self.timestamp_s, *self.stamps),
        ]
        if version >= (4, 0):
            parts.append(struct.pack("<II", 77, 88))
        return b"".join([*parts, struct.pack("<H", self.flags), self.tail])


def definitions(names, version):
    """Model definitions with the body names `{id: name}`, between definitions of every other kind."""

    def body(id, name):
        data = name.encode() + b"\0" + struct.pack("<ii3f", id, -1, 0, 0, 0)
        if version >= (4, 2):
            data += struct.pack("<4f", 0, 0, 0, 1)
        data += struct.pack("<i", 2) + struct.pack("<6f", *range(6)) + struct.pack("<ii", 1, 2)
        return data + (b"Marker 1\0Marker 2\0" if version >= (4, 0) else b"")

    channels = struct.pack("<i", 2) + b"Fx\0Fy\0"
    kinds = [
        (0, b"Box\0" + struct.pack("<i", 2) + b"one\0two\0"),
        (2, b"Ann\0" + struct.pack("<ii", 3, 2) + body(1, "Hip") + body(2, "Chest")),
        (3, struct.pack("<i", 1) + b"SN1\0" + bytes(4 * (2 + 3 + 144 + 12 + 2)) + channels),
        (4, struct.pack("<i", 1) + b"Glove\0SN2\0" + bytes(8) + channels),
        (5, b"Camera 1\0" + struct.pack("<7f", 0, 0, 0, 0, 0, 0, 1)),
    ]
    if version >= (4, 1):
        asset = b"Coat\0" + struct.pack("<iii", 1, 4, 1) + body(1, "Bone") + struct.pack("<i", 1)
        kinds.append((6, asset + b"m\0" + struct.pack("<i3ffh", 1, 0, 0, 0, 0.01, 0)))
    kinds += [(1, body(id, name)) for id, name in names.items()]
    data = struct.pack("<i", len(kinds))
    for kind, content in kinds:
        data += struct.pack("<i", kind)
        data += (struct.pack("<i", len(content)) if version >= (4, 1) else b"") + content
    return data


def server_info(
    version=(3, 0), clock_hz=1_000_000, data_port=1511, group: str | None = "239.255.42.99", name=b"Motive"
):
    """The payload of `SERVER_INFO`. Without a `group`, the server uses unicast."""
    return (
        name.ljust(256, b"\0")
        + bytes([2, 1, 0, 0, *version, 0, 0])
        + struct.pack("<QHB", clock_hz, data_port, group is not None)
        + bytes(map(int, (group or "0.0.0.0").split(".")))
    )


def packet(message_id, payload=b""):
    return struct.pack("<HH", message_id, len(payload)) + payload
