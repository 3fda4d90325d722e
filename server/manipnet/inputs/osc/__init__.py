"""Tracked bodies over Open Sound Control, on UDP."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from manipnet.common.options import Port, option
from manipnet.inputs.declaration import Input, Receiver, Reception

if TYPE_CHECKING:
    from manipnet.inputs.playback import BodySender


@dataclass(frozen=True)
class OscOptions:
    """Where OSC is received."""

    osc_port: int = option(39540, Port(), "UDP port for tracked bodies over OSC")


def _open(options: OscOptions, reception: Reception) -> Receiver:
    from manipnet.inputs.osc.receiver import OscBodies

    return OscBodies(reception.intake, reception.host, options.osc_port, reception.allow)


def _player(host: str, port: int) -> "BodySender":
    from manipnet.inputs.playback import OscBodySender

    return OscBodySender(host, port)


OSC = Input(
    "osc",
    "OSC: the sender sends datagrams",
    OscOptions,
    _open,
    drop_reasons=("malformed", "not_allowed", "rate", "kernel", "incomplete"),
    transport="udp",
    player=_player,
)
