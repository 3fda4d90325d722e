"""Tracked bodies over Open Sound Control, on UDP."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from manipnet.common.options import Choice, Port, Switch, option
from manipnet.inputs.declaration import Input, Receiver, Reception
from manipnet.inputs.osc.declared import Addresses
from manipnet.inputs.osc.patterns import Pattern

if TYPE_CHECKING:
    from manipnet.inputs.playback import BodySender


@dataclass(frozen=True)
class OscOptions:
    """Where OSC is received, and what its messages mean."""

    osc_port: int = option(39540, Port(), "UDP port for tracked bodies over OSC")
    osc_up: Literal["y", "z"] = option("y", Choice(("y", "z")), "the up axis of a NatNet bridge that sends OSC")
    osc_left_handed: bool = option(False, Switch(), "a NatNet bridge that sends OSC gives left-handed poses")
    osc_address: tuple[Pattern, ...] = option(
        (), Addresses(), "one more OSC address that is understood, and what its arguments mean; repeatable"
    )

    @property
    def bridge_axes(self) -> str:
        """The axes of NatNet bridges, as a key of `space.AXES`."""
        return {
            ("y", False): "y-up",
            ("z", False): "z-up",
            ("y", True): "unity",
            ("z", True): "z-up left",
        }[self.osc_up, self.osc_left_handed]


def _open(options: OscOptions, reception: Reception) -> Receiver:
    from manipnet.inputs.osc.addresses import AddressBook
    from manipnet.inputs.osc.receiver import OscBodies

    book = AddressBook(options.osc_address, options.bridge_axes, reception.bodies)
    return OscBodies(reception.intake, reception.host, options.osc_port, reception.allow, book, reception.record)


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
