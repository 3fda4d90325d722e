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

    def write(self, version=(3, 0)):
        pose = struct.pack("<i3f4f", self.id, *self.p, *self.q)
        if version < (3, 0):  # two markers: positions, ids, sizes
            pose += struct.pack("<i6f2i2f", 2, *range(6), 1, 2, 0.01, 0.01)
        return pose + struct.pack("<fh", self.error, self.params)


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
    skeletons: dict = field(default_factory=lambda: {9: [Body(0), Body(1), Body(2)]})
    timecode: int = 0x01020304

    def write(self, version):
        def section(elements):
            data = b"".join(elements)
            size = struct.pack("<i", len(data)) if version >= (4, 1) else b""
            return struct.pack("<i", len(elements)) + size + data

        some = self.full
        vector = struct.pack("<3f", 1, 2, 3)
        marker_sets = [b"Box\0" + struct.pack("<i", 2) + 2 * vector, b"all\0" + struct.pack("<i", 0)]
        skeletons = [
            struct.pack("<ii", id, len(bones)) + b"".join(bone.write(version) for bone in bones)
            for id, bones in self.skeletons.items()
        ]
        asset = struct.pack("<ii", 5, 1) + Body(1).write() + struct.pack("<i", 1) + bytes(26)
        labelled = struct.pack("<i3ffh", 0x20001, 1, 2, 3, 0.01, 2)
        if version >= (3, 0):
            labelled += struct.pack("<f", 0.0005)
        plate = struct.pack("<iiififf", 1, 2, 1, 0.5, 2, 0.5, 0.25)
        parts = [
            struct.pack("<i", self.number),
            section(marker_sets if some else []),
            section([vector] * 5 if some else []),
            section([body.write(version) for body in self.bodies]),
            section(skeletons if some else []),
        ]
        if version >= (4, 1):
            parts.append(section([asset] if some else []))
        parts.append(section([labelled] * 6 if some else []))
        if version >= (2, 9):
            parts.append(section([plate] if some else []))
        if version >= (3, 0):
            parts.append(section([plate, plate] if some else []))
        else:
            parts.append(struct.pack("<f", 0.5))  # software latency
        parts.append(struct.pack("<IId", self.timecode, 5, self.timestamp_s))
        if version >= (3, 0):
            parts.append(struct.pack("<3Q", *self.stamps))
        if version >= (4, 0):
            parts.append(struct.pack("<II", 77, 88))
        return b"".join([*parts, struct.pack("<H", self.flags), self.tail])


def definitions(names, version, skeletons=None):
    """Model definitions with the body names `{id: name}`, between definitions of every other kind.

    `names` may be pairs, so that an id may occur twice; names may be bytes. `skeletons` are `{id: (name, {id: bone})}`.
    """
    pairs = list(names.items() if isinstance(names, dict) else names)
    skeletons = {3: ("Ann", {1: "Hip", 2: "Chest"})} if skeletons is None else skeletons

    def body(id, name):
        data = (name if isinstance(name, bytes) else name.encode()) + b"\0" + struct.pack("<ii3f", id, -1, 0, 0, 0)
        if version < (3, 0):
            return data
        if version >= (4, 2):
            data += struct.pack("<4f", 0, 0, 0, 1)
        data += struct.pack("<i", 2) + struct.pack("<6f", *range(6)) + struct.pack("<ii", 1, 2)
        return data + (b"Marker 1\0Marker 2\0" if version >= (4, 0) else b"")

    channels = struct.pack("<i", 2) + b"Fx\0Fy\0"
    kinds = [
        (0, b"Box\0" + struct.pack("<i", 2) + b"one\0two\0"),
        *(
            (
                2,
                name.encode()
                + b"\0"
                + struct.pack("<ii", id, len(bones))
                + b"".join(body(*each) for each in bones.items()),
            )
            for id, (name, bones) in skeletons.items()
        ),
        (3, struct.pack("<i", 1) + b"SN1\0" + bytes(4 * (2 + 3 + 144 + 12 + 2)) + channels),
        (4, struct.pack("<i", 1) + b"Glove\0SN2\0" + bytes(8) + channels),
        (5, b"Camera 1\0" + struct.pack("<7f", 0, 0, 0, 0, 0, 0, 1)),
    ]
    if version >= (4, 1):
        asset = b"Coat\0" + struct.pack("<iii", 1, 4, 1) + body(1, "Bone") + struct.pack("<i", 1)
        kinds.append((6, asset + b"m\0" + struct.pack("<i3ffh", 1, 0, 0, 0, 0.01, 0)))
    if version < (3, 0):
        kinds = [each for each in kinds if each[0] < 3]
    kinds += [(1, body(id, name)) for id, name in pairs]
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
