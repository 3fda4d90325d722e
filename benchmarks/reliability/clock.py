"""How well the server and its clients measure the offset between two clocks, where the true offset is known.

All processes of this machine share one monotonic clock, so a client's true offset to the server is zero; the clock of
the fake Motive is ahead by a known time. A measurement sends eight pings and uses the one with the shortest round trip.
"""

import time

import msgpack
import numpy as np
import zmq

from benchmarks.support import FakeMotive, LiveServer, serving
from manipnet.net.clock_offset import ClockOffset, measure_offset

from .row import Row, parser, report

ERROR_S = 0.2e-3
PAUSE_S = 0.2
"""The server delays requests above a rate that no client has; a client measures every few seconds."""
NAMES = {1: "left_wrist", 2: "right_wrist", 3: "Box"}


def control_offsets(server: LiveServer, measurements: int) -> list[ClockOffset]:
    """A client's offset to the server by the request `ping`, measured `measurements` times."""
    with zmq.Context() as context, context.socket(zmq.REQ) as req:
        req.setsockopt(zmq.LINGER, 0)
        req.connect(server.addresses["control"])
        question = msgpack.packb({"op": "ping"}) or b""

        def ping() -> float:
            req.send(question)
            return msgpack.unpackb(req.recv())["t"]

        found = []
        for _ in range(measurements):
            found.append(measure_offset(ping, time.monotonic))
            time.sleep(PAUSE_S)
        return found


def row(what: str, errors_s: np.ndarray, bounds_s: np.ndarray) -> Row:
    """The row for errors `(n,)` and the uncertainties `(n,)` that were published with them."""
    inside = float(np.mean(np.abs(errors_s) <= bounds_s))
    return Row(
        f"{what}, {len(errors_s)} times",
        f"error < {1e3 * ERROR_S:g} ms",
        f"{1e6 * np.median(np.abs(errors_s)):.0f} µs median, {1e6 * np.percentile(np.abs(errors_s), 99):.0f} µs p99, "
        f"{1e6 * np.abs(errors_s).max():.0f} µs at most; inside the published uncertainty (median "
        f"{1e6 * np.median(bounds_s):.0f} µs) {100 * inside:.1f} %",
        bool(np.abs(errors_s).max() < ERROR_S),
        {"errors_s": list(errors_s), "uncertainties_s": list(bounds_s)},
    )


def main() -> None:
    options = parser(__doc__, 20.0)
    options.add_argument(
        "--measurements", type=int, default=100, help="number of measurements by the client (default: %(default)s)"
    )
    arguments = options.parse_args()
    with FakeMotive((4, 1), NAMES) as motive, serving("--natnet", f"127.0.0.1:{motive.port}") as server:
        found = control_offsets(server, arguments.measurements)
        rows = [row("client to server by ping", *np.array([(o.offset_s, o.uncertainty_s) for o in found]).T)]
        samples = []
        for _ in range(round(arguments.seconds)):
            time.sleep(1.0)
            natnet = server.ask({"op": "status"})["natnet"]
            samples.append((natnet["clock_offset_s"] - motive.clock_offset_s, natnet["clock_uncertainty_s"]))
        rows.append(row("server to Motive by echo", *np.array(samples).T))
    report("clock", rows, arguments.out)


if __name__ == "__main__":
    main()
