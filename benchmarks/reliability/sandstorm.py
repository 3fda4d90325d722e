"""A flood for `flood`: so many garbage datagrams a second to `HOST:PORT` from another loopback address, until killed.

Half of them are noise, half a good OSC bundle with damage. A process of its own, so that it takes nothing of the
measuring one but the processor.
"""

import random
import socket
import sys
import time

from manipnet.inputs.osc.writer import osc_datagrams
from manipnet.wire.bodies import BodyFrame, BodySample

BURST_S = 0.001


def garbage(rng: random.Random, count: int = 512) -> list[bytes]:
    """Datagrams that no reader can use."""
    good = osc_datagrams(BodyFrame(1.0, 1, (BodySample(None, "left_wrist", (0, 1, 0), (0, 0, 0, 1), True),), 0.0, ""))[
        0
    ]
    noise = [rng.randbytes(rng.randrange(1, 400)) for _ in range(count // 2)]
    return noise + [_damaged(good, rng) for _ in range(count // 2)]


def _damaged(good: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(16, len(good) - 4)
    return good[:at] + b"\xff\xff\xff\xff" + good[at + 5 :]


def main() -> None:
    host, _, port = sys.argv[1].rpartition(":")
    rate_hz = float(sys.argv[2])
    datagrams = garbage(random.Random(1))
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(("127.0.0.2", 0))
    udp.connect((host, int(port)))
    start_s, sent, said_s = time.monotonic(), 0, 0.0
    while True:
        elapsed_s = time.monotonic() - start_s
        while sent < elapsed_s * rate_hz:
            udp.send(datagrams[sent % len(datagrams)])
            sent += 1
        if elapsed_s - said_s > 0.5:
            said_s = elapsed_s
            print(elapsed_s, sent, flush=True)
        time.sleep(BURST_S)


if __name__ == "__main__":
    main()
