"""Send garbage datagrams to an address, from another loopback address, until killed.

Half of them are noise, the others are damaged OSC bundles. `flood` runs this as a separate process, so that it does not
slow the measuring process down.
"""

import argparse
import random
import socket
import time

from manipnet.inputs.osc.writer import osc_datagrams
from manipnet.wire.bodies import BodyFrame, BodySample

BURST_S = 0.001


def garbage(rng: random.Random, count: int = 512) -> list[bytes]:
    """Datagrams that no reader can parse."""
    body = BodySample(None, "left_wrist", (0, 1, 0), (0, 0, 0, 1), True)
    (good,) = osc_datagrams(BodyFrame(1.0, 1, (body,), 0.0, ""))
    noise = [rng.randbytes(rng.randrange(1, 400)) for _ in range(count // 2)]
    return noise + [_damaged(good, rng) for _ in range(count // 2)]


def _damaged(good: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(16, len(good) - 4)
    return good[:at] + b"\xff\xff\xff\xff" + good[at + 5 :]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("address", metavar="HOST:PORT")
    parser.add_argument("rate_hz", type=float, metavar="RATE_HZ", help="datagrams a second")
    arguments = parser.parse_args()
    host, _, port = arguments.address.rpartition(":")
    datagrams = garbage(random.Random(1))
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(("127.0.0.2", 0))
    udp.connect((host, int(port)))
    start_s, sent, printed_s = time.monotonic(), 0, 0.0
    while True:
        elapsed_s = time.monotonic() - start_s
        while sent < elapsed_s * arguments.rate_hz:
            udp.send(datagrams[sent % len(datagrams)])
            sent += 1
        if elapsed_s - printed_s > 0.5:
            printed_s = elapsed_s
            print(elapsed_s, sent, flush=True)
        time.sleep(BURST_S)


if __name__ == "__main__":
    main()
