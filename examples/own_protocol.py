"""Own protocol: a server that also receives tracked bodies as lines of text over UDP, added from this one file.

    python examples/own_protocol.py --mesh Box=cube [any option of manipnet-serve]

Each datagram is one frame: a line with the time in seconds, then a line for each body with its name, position (metres)
and quaternion, separated by spaces. The declaration at the end gives the protocol its flag, its key in rig files and
its counters. To make it part of the server, put this file into server/manipnet/inputs/ and its declaration into the
tuple `INPUTS` there; `manipnet doctor` and the tables of the documentation then know it too.
"""

import sys
from dataclasses import dataclass

from manipnet import cli, inputs
from manipnet.common.options import Port, option
from manipnet.inputs.declaration import Input, Receiver, Reception
from manipnet.net.supervised import ReceiverHealth
from manipnet.net.udp import UdpThread, bind_udp
from manipnet.wire.bodies import MAX_TIME_S, BodyFrame, BodySample, check_distinct, check_name, make_sample


@dataclass(frozen=True)
class TextOptions:
    """Where lines of text are received."""

    text_port: int = option(7000, Port(), "UDP port for tracked bodies as lines of text")


class TextBodies(Receiver):
    """Receives lines of text on a thread of its own."""

    def __init__(self, options: TextOptions, reception: Reception) -> None:
        self._intake, self._host, self._port = reception.intake, reception.host, options.text_port
        self._thread: UdpThread | None = None

    def start(self) -> None:
        """Bind the port and begin to receive."""
        udp = bind_udp(self._host, self._port)
        host, port = udp.getsockname()
        self.address = f"udp://{host}:{port}"
        health = ReceiverHealth("text", self._intake.telemetry)
        self._thread = UdpThread(
            udp,
            reopen=lambda: bind_udp(host, port),
            receive=self._receive,
            idle=lambda now_s: 0.1,
            lost=lambda count: None,
            health=health,
        )
        self._thread.start()

    def stop(self) -> None:
        """Stop receiving and free the port."""
        if self._thread is not None:
            self._thread.stop()
            self._thread = None

    def _receive(self, datagram: bytes, sender: tuple[str, int], now_s: float) -> None:
        source = f"text:{sender[0]}:{sender[1]}"
        try:
            self._intake.accept(frame(datagram, now_s, source))
        except ValueError as error:  # what arrives from outside may be anything
            self._intake.drop("malformed", source, error)


def frame(datagram: bytes, now_s: float, source: str) -> BodyFrame:
    """The frame of a datagram. Raises `ValueError` for anything else."""
    time, *lines = datagram.decode("utf-8").splitlines()
    if not abs(float(time)) <= MAX_TIME_S:
        raise ValueError(f"the time is {time}; it must be in seconds, at most {MAX_TIME_S:g}")
    bodies = tuple(map(body, lines))
    check_distinct(bodies)
    return BodyFrame(float(time), None, bodies, now_s, source)


def body(line: str) -> BodySample:
    """A body from a line of text. Raises `ValueError` for anything else."""
    name, x, y, z, qx, qy, qz, qw = line.split()
    p, q = (float(x), float(y), float(z)), (float(qx), float(qy), float(qz), float(qw))
    return make_sample(None, check_name(name, "the name"), p, q, tracked=True)


TEXT = Input("text", "Lines of text over UDP", TextOptions, TextBodies, transport="udp")

if __name__ == "__main__":
    inputs.INPUTS += (TEXT,)
    sys.exit(cli.main())
