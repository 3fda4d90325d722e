"""Hands as VMC (Virtual Motion Capture) bones, over OSC."""

from dataclasses import dataclass

from manipnet.common.options import Endpoint, HostPort, option
from manipnet.outputs.declaration import Emission, HandsOutput, Output

DEFAULT_PORT = 39539


@dataclass(frozen=True)
class VmcOptions:
    """Where VMC bones are sent."""

    vmc: Endpoint | None = option(None, HostPort(DEFAULT_PORT), "send VMC bones to that program, OSC over UDP")


def _open(options: VmcOptions, emission: Emission) -> HandsOutput:
    from manipnet.net.udp import resolve
    from manipnet.outputs.vmc.sender import VmcSender

    assert options.vmc is not None  # `open_outputs` opens what is turned on
    return VmcSender(*resolve(*options.vmc), emission.hand)


VMC = Output("vmc", "VMC bones, OSC over UDP, for programs that show avatars", VmcOptions, _open)
