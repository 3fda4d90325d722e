"""Publish moving hands as `manipnet-serve` does, without a server; the line `ready` names the addresses."""

import argparse
import itertools
import time
from dataclasses import replace

import numpy as np
import zmq

from manipnet.geometry import Side
from manipnet.outputs.websocket.server import WebSocketPublisher
from manipnet.telemetry import Telemetry
from manipnet.wire import (
    TOPIC_BIN,
    TOPIC_MSGPACK,
    BodyPose,
    HandPose,
    HandsMessage,
    encode_binary,
    encode_msgpack,
)

RATE_HZ = 60
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


def hand(x_m: float, turn_rad: float) -> HandPose:
    """A hand at `(x, 0, 0)`, turned about z: every joint equals the wrist, every angle equals the turn.

    Every bone is turned by a quarter of it about y.
    """
    quat = np.array([0.0, 0.0, np.sin(turn_rad / 2), np.cos(turn_rad / 2)])
    pose = np.array([x_m, 0.0, 0.0, *quat])
    rotations = np.tile([0.0, np.sin(turn_rad / 8), 0.0, np.cos(turn_rad / 8)], (17, 1))
    rotations[0] = IDENTITY
    return HandPose("live", "cube", 1.0, np.full(20, turn_rad), rotations, pose, np.tile(pose, (26, 1)))


def message(seq: int, t_capture: float, x_m: float, session: str = "s") -> HandsMessage:
    """A message with both hands at `x`, turned by `x` and `-x` radians, and a cube at `x`."""
    body = BodyPose(True, np.array([x_m, 0.0, 0.0, *IDENTITY]), "cube")
    hands: dict[Side, HandPose] = {"left": hand(x_m, x_m), "right": hand(x_m, -x_m)}
    return HandsMessage(session, "actor", seq, t_capture, time.monotonic(), 0.5, hands, (body,))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--websocket-port", type=int, default=0)
    parser.add_argument("--session", default="s")
    parser.add_argument("--token", help="the token that the WebSocket asks for")
    parser.add_argument("--rate", type=float, default=RATE_HZ)
    parser.add_argument("--timecode", help="send this timecode, at 29.97 frames per second", metavar="HH:MM:SS:FF")
    parser.add_argument(
        "--skip", type=int, default=0, help="leave out every N-th frame, as a lossy network does", metavar="N"
    )
    options = parser.parse_args()
    socket = zmq.Context.instance().socket(zmq.PUB)
    socket.setsockopt(zmq.LINGER, 0)
    socket.setsockopt(zmq.HEARTBEAT_IVL, 200)
    socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, 1000)
    port = options.port or socket.bind_to_random_port("tcp://127.0.0.1")
    if options.port:
        socket.bind(f"tcp://127.0.0.1:{port}")
    websocket = WebSocketPublisher(Telemetry(), "127.0.0.1", options.websocket_port, options.token)
    print(f"ready tcp://127.0.0.1:{port} {websocket.address}", flush=True)
    start = time.monotonic()
    for seq in itertools.count():
        due = start + seq / options.rate
        time.sleep(max(due - time.monotonic(), 0.0))
        if options.skip and seq % options.skip == 0:
            continue
        out = message(seq, seq / RATE_HZ, np.sin(seq / RATE_HZ), options.session)
        if options.timecode:
            out = replace(out, timecode=options.timecode, timecode_rate=29.97)
        payload = encode_binary(out)
        socket.send(TOPIC_BIN + payload)
        websocket.publish(payload)
        socket.send(TOPIC_MSGPACK + encode_msgpack(out))


if __name__ == "__main__":
    main()
