"""Hands over ZeroMQ, for every client of the project."""

from dataclasses import dataclass

from manipnet.common.options import Port, option
from manipnet.outputs.declaration import Emission, HandsOutput, Output


@dataclass(frozen=True)
class ZmqOutputOptions:
    """Where hands are published over ZeroMQ."""

    port: int = option(5555, Port(), "TCP port for clients that receive hands over ZeroMQ (PUB)")


def _open(options: ZmqOutputOptions, emission: Emission) -> HandsOutput:
    from manipnet.outputs.zeromq.publisher import ZmqPublisher

    return ZmqPublisher(emission.telemetry, emission.host, options.port, emission.keys)


ZEROMQ = Output(
    "zmq",
    "ZeroMQ PUB: `pose/msgpack …` and `pose/bin …`, for the clients of this project",
    ZmqOutputOptions,
    _open,
    topics=("msgpack", "bin"),
    ready_name="hands",
)
