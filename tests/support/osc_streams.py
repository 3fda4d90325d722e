"""OSC senders as people have them, for tests: each makes the datagrams of one frame."""

import math
import socket
import struct
import time
from collections.abc import Callable, Sequence

from osc_writer import bundle, osc

HZ = 120
NTP = 2_208_988_800
Pose = tuple[float, ...]
Datagrams = Callable[[int], Sequence[bytes]]


def poses(k: int, hz: float = HZ) -> tuple[Pose, Pose, Pose]:
    """Two wrists that circle around a prop at frame `k`, each x y z qx qy qz qw."""
    a = math.pi * k / hz
    noise = 1e-4 * math.sin(37.0 * k)
    return (
        (-0.2 + 0.05 * math.cos(a), 1.0 + noise, 0.05 * math.sin(a), 0.0, 0.0, math.sin(a / 9), math.cos(a / 9)),
        (0.2 + 0.05 * math.sin(a), 1.0 - noise, 0.05 * math.cos(a), 0.0, math.sin(a / 7), 0.0, math.cos(a / 7)),
        (0.02 * math.sin(a), 1.0 + noise, 0.0, 0.0, math.sin(a / 5), 0.0, math.cos(a / 5)),
    )


def bodies(k: int, hz: float = HZ) -> list[tuple[int, Pose]]:
    """The same with their ids."""
    return list(enumerate(poses(k, hz), 1))


def milliseconds(k: int) -> int:
    """The whole milliseconds of a program that was started an hour and a half ago."""
    return 5_400_000 + 1000 * k // HZ


def bridge(k: int, *more: bytes) -> list[bytes]:
    """The messages of a NatNet bridge."""
    return [
        osc("/frame/start", 9000 + k),
        osc("/frame/timestamp", milliseconds(k)),
        *(message for i, p in bodies(k) for message in transformation(i, p)),
        *more,
        osc("/frame/end", 9000 + k),
    ]


def transformation(i: int | str, p: Pose) -> list[bytes]:
    """One body in the bridge's mode for TouchDesigner."""
    return [osc(f"/rigidbody/{i}/tracked", 1), osc(f"/rigidbody/{i}/transformation", *p)]


def vmc(k: int, tag: int = 1, extra: Sequence[bytes] = (), hz: float = HZ) -> bytes:
    """A bundle with three VMC trackers and the time of the sender."""
    trackers = [osc("/VMC/Ext/Tra/Pos", str(i), *p) for i, p in bodies(k, hz)]
    return bundle(osc("/VMC/Ext/OK", 1), osc("/VMC/Ext/T", k / hz), *trackers, *extra, tag=tag)


def raw(address: bytes, tags: bytes, data: bytes = b"") -> bytes:
    """A message that no library writes."""
    return b"".join(part + bytes(4 - len(part) % 4) for part in (address, tags)) + data


def ntp(seconds: float) -> int:
    """The time tag of a time since 1970."""
    whole = math.floor(seconds)
    return (whole + NTP << 32) + int((seconds - whole) * 2**32)


def stream(port: int, frame: Datagrams, seconds: float, hz: float = HZ) -> int:
    """Send frames in real time to a port of this machine; returns how many."""
    frames = round(seconds * hz)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        start_s = time.monotonic()
        for k in range(frames):
            for datagram in frame(k):
                udp.sendto(datagram, ("127.0.0.1", port))
            time.sleep(max(0.0, start_s + (k + 1) / hz - time.monotonic()))
    return frames


def float64(value: float) -> bytes:
    """The data of a `d` argument."""
    return struct.pack(">d", value)
