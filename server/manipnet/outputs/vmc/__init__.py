"""Hands as VMC (Virtual Motion Capture) bones, over OSC."""

from dataclasses import dataclass

from manipnet.common.options import Endpoint, HostPort, Switch, Text, option
from manipnet.outputs.declaration import Emission, HandsOutput, Output

DEFAULT_PORT = 39539


@dataclass(frozen=True)
class VmcOptions:
    """Where VMC bones are sent."""

    vmc: Endpoint | None = option(None, HostPort(DEFAULT_PORT), "send VMC bones to that program, OSC over UDP")
    vmc_fingers_only: bool = option(
        False, Switch(), "leave the hand bones out of VMC, because another program moves the body"
    )
    vmc_actor: str | None = option(None, Text("NAME"), "actor that is sent over VMC; without it, the first one")


def _open(options: VmcOptions, emission: Emission) -> HandsOutput:
    from manipnet.net.udp import resolve
    from manipnet.outputs.vmc.sender import VmcSender

    assert options.vmc is not None  # `open_outputs` opens what is turned on
    host, port = resolve(*options.vmc)
    return VmcSender(host, port, emission.hand, options.vmc_fingers_only, options.vmc_actor, emission.avatars)


VMC = Output("vmc", "VMC bones, OSC over UDP, for programs that show avatars", VmcOptions, _open)
