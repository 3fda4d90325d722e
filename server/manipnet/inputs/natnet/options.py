"""The options of NatNet."""

from dataclasses import dataclass
from typing import Final, Literal

from manipnet.common.options import Choice, Endpoint, HostPort, Switch, Text, option

COMMAND_PORT: Final = 1510
UpAxis = Literal["y", "z"]


@dataclass(frozen=True)
class NatNetOptions:
    """The Motive to connect to, and how it streams."""

    natnet: Endpoint | None = option(
        None, HostPort(COMMAND_PORT, "SERVER"), "connect to OptiTrack Motive on that machine"
    )
    multicast: bool = option(False, Switch(), "receive what Motive streams by multicast")
    interface: str | None = option(None, Text("ADDRESS"), "address of this machine's network card that faces Motive")
    up: UpAxis = option("y", Choice(("y", "z")), "the up axis in Motive's streaming settings")
