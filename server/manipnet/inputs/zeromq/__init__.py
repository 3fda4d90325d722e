"""Tracked bodies over ZeroMQ."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from manipnet.common.options import Endpoint, Endpoints, Port, option
from manipnet.inputs.declaration import Input, Receiver, Reception

if TYPE_CHECKING:
    from manipnet.inputs.playback import BodySender


@dataclass(frozen=True)
class ZmqInputOptions:
    """Where bodies are received over ZeroMQ."""

    input_port: int = option(5556, Port(), "TCP port for tracked bodies over ZeroMQ (SUB)")
    connect: tuple[Endpoint, ...] = option(
        (), Endpoints("tcp"), "connect to a tracker that binds its ZeroMQ socket (PUB); repeatable"
    )


def _open(options: ZmqInputOptions, reception: Reception) -> Receiver:
    from manipnet.inputs.zeromq.receiver import ZmqBodies

    return ZmqBodies(reception.intake, reception.host, options.input_port, reception.keys, options.connect)


def _player(host: str, port: int) -> "BodySender":
    from manipnet.inputs.playback import ZmqBodySender

    return ZmqBodySender(host, port)


ZEROMQ = Input(
    "zmq",
    "ZeroMQ: the sender's PUB socket connects",
    ZmqInputOptions,
    _open,
    drop_reasons=("malformed", "oversized", "rate", "backlog"),
    transport="tcp",
    ready_name="bodies",
    scheme="tcp",
    player=_player,
)
