"""Reads a real NatNet capture: its UDP packets, and the output of the vendor's client."""

import os
import re
import struct
from collections import namedtuple
from pathlib import Path

import pytest

Datagram = namedtuple("Datagram", "time_s source port destination destination_port data")


def folder() -> Path:
    """The folder of the capture, MANIPNET_NATNET or beside the take data. Skips the test if there is none."""
    beside = Path(os.environ.get("MANIPNET_DATA", "")).parent / "natnet"
    path = Path(os.environ.get("MANIPNET_NATNET", beside))
    if not (path / "traffic.pcapng").is_file():
        pytest.skip(f"no NatNet capture at {path}: set MANIPNET_NATNET to the folder of traffic.pcapng")
    return path


def datagrams(path=None):
    """Every UDP datagram of the capture in order (pcapng, one Ethernet interface, microseconds)."""
    data = ((path or folder()) / "traffic.pcapng").read_bytes()
    offset = 0
    while offset < len(data):
        kind, size = struct.unpack_from("<II", data, offset)
        body = data[offset + 8 : offset + size - 4]
        offset += size
        if kind != 6:
            continue
        _, high, low, length, _ = struct.unpack_from("<5I", body)
        ip = body[20 : 20 + length][14:]
        udp = ip[(ip[0] & 15) * 4 :]
        if body[32:34] != b"\x08\0" or ip[9] != 17:
            continue
        port, to_port, udp_size, _ = struct.unpack(">4H", udp[:8])
        source, to = (".".join(map(str, ip[at : at + 4])) for at in (12, 16))
        yield Datagram((high << 32 | low) * 1e-6, source, port, to, to_port, udp[8:udp_size])


def frames():
    """The payloads of the capture's 518 frame packets."""
    return [d.data[4:] for d in datagrams() if d.data[:2] == b"\x07\0"]


NUMBER = r"(-?\d+\.\d+)"


def printed_frames():
    """What the vendor's client printed for each frame it saw, `{frame number: {…}}`.

    It was printed from two threads: a frame whose lines are torn is left out.
    """
    text = (folder() / "SampleClient_output.txt").read_text().replace("\r", "")
    result = {}
    for part in text.split("FrameID : ")[1:]:
        number = re.match(r"\d+", part)
        timestamp = re.search(rf"^Timestamp : {NUMBER}$", part, re.M)
        software = re.search(rf"^Software latency : {NUMBER} milliseconds$", part, re.M)
        system = re.search(rf"^System latency : {NUMBER} milliseconds$", part, re.M)
        head = re.search(r"^Rigid Body \[ID=(\d+)  Error=(\d+\.\d+)  Valid=(\d)\]$", part, re.M)
        pose = re.search(rf"^\t{NUMBER}\t{NUMBER}\t{NUMBER}\t{NUMBER}\t{NUMBER}\t{NUMBER}\t{NUMBER}$", part, re.M)
        if number and timestamp and software and system and head and pose:
            result[int(number[0])] = {
                "timestamp_s": float(timestamp[1]),
                "software_ms": float(software[1]),
                "system_ms": float(system[1]),
                "id": int(head[1]),
                "mean_error": float(head[2]),
                "tracked": head[3] == "1",
                "pose": [float(value) for value in pose.groups()],
            }
    return result
