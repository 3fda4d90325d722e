"""Hands in Epic's JSON Live Link format, for Unreal Engine."""

from dataclasses import dataclass

from manipnet.common.options import Endpoint, HostPort, option
from manipnet.outputs.declaration import Emission, HandsOutput, Output

DEFAULT_PORT = 54321


@dataclass(frozen=True)
class LiveLinkOptions:
    """Where Live Link subjects are sent."""

    livelink: Endpoint | None = option(
        None, HostPort(DEFAULT_PORT), "send JSON Live Link subjects to that Unreal Engine, over UDP"
    )


def _open(options: LiveLinkOptions, emission: Emission) -> HandsOutput:
    from manipnet.net.udp import resolve
    from manipnet.outputs.livelink.sender import LiveLinkJsonSender

    assert options.livelink is not None  # `open_outputs` opens what is turned on
    return LiveLinkJsonSender(*resolve(*options.livelink), emission.avatars.values())


LIVELINK = Output("livelink", "JSON Live Link over UDP, for Unreal Engine's sample receiver", LiveLinkOptions, _open)
