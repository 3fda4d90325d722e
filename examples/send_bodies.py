"""Send bodies: stand in for a tracking system, with two wrists and a box that swings between them.

    manipnet-serve --mesh Box=cube
    python examples/send_bodies.py [tcp://127.0.0.1:5556]

Each ZeroMQ message is one frame, in JSON or msgpack: the time at which the tracker saw the bodies, and every body that
it saw. Poses are right-handed, Y up, in metres, with quaternions x y z w; docs/protocol-in.md lists the keys.
"""

import contextlib
import itertools
import math
import sys
import time
from collections.abc import Iterator

import zmq

RATE_HZ = 120.0


def main(address: str = "tcp://127.0.0.1:5556") -> None:
    """Send 120 frames a second until interrupted."""
    with zmq.Context() as context, context.socket(zmq.PUB) as socket:
        socket.connect(address)
        for t_s in frame_times():
            socket.send_json({"t": t_s, "bodies": bodies(t_s)})


def frame_times() -> Iterator[float]:
    """The instants at which the tracker sees a frame, each yielded when it has come."""
    begin_s = time.monotonic()
    for frame in itertools.count():
        t_s = begin_s + frame / RATE_HZ
        time.sleep(max(t_s - time.monotonic(), 0.0))
        yield t_s


def bodies(t_s: float) -> list[dict]:
    """Both wrists and the box at an instant."""
    x = 0.05 * math.sin(3.0 * t_s)
    places = {"left_wrist": (x + 0.14, 1.0, 0.05), "right_wrist": (x - 0.14, 1.0, 0.05), "Box": (x, 1.0, 0.0)}
    return [{"name": name, "p": place, "q": (0.0, 0.0, 0.0, 1.0), "tracked": True} for name, place in places.items()]


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        main(*sys.argv[1:])
