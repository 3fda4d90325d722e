"""Send bodies: stand in for a tracking system, with two wrists and a box between them.

    manipnet-serve --mesh Box=cube
    python examples/send_bodies.py [tcp://127.0.0.1:5556]

Each ZeroMQ message is one frame: the time at which the tracker saw the bodies, and every body it saw. Right-handed, Y up,
metres, quaternions x y z w; docs/reference/protocol-in.md lists the keys.
"""

import math
import sys
import time

import msgpack
import zmq

RATE_HZ = 120.0
TURNED = (0.0, 0.0, 0.0, 1.0)


def main(address: str = "tcp://127.0.0.1:5556") -> None:
    """Send 120 frames a second until interrupted."""
    socket = zmq.Context.instance().socket(zmq.PUB)
    socket.connect(address)
    begin_s = time.monotonic()
    frame = 0
    while True:
        t_s = frame / RATE_HZ
        time.sleep(max(begin_s + t_s - time.monotonic(), 0.0))
        socket.send(msgpack.packb({"t": begin_s + t_s, "frame": frame, "bodies": bodies(t_s)}))
        frame += 1


def bodies(t_s: float) -> list[dict]:
    """Where the tracker sees both wrists and the box, which swings from side to side."""
    x = 0.05 * math.sin(3.0 * t_s)
    places = {"left_wrist": (x - 0.17, 1.0, 0.05), "right_wrist": (x + 0.17, 1.0, 0.05), "Box": (x, 1.0, 0.0)}
    return [{"name": name, "p": place, "q": TURNED, "tracked": True} for name, place in places.items()]


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except KeyboardInterrupt:
        pass
