"""Tracked bodies from OptiTrack Motive, over its own protocol NatNet."""

from manipnet.inputs.declaration import Input, Receiver, Reception
from manipnet.inputs.natnet.options import NatNetOptions


def _open(options: NatNetOptions, reception: Reception) -> Receiver:
    from manipnet.inputs.natnet.client import NatNetBodies

    return NatNetBodies(reception.intake, options, reception.allow, reception.bodies)


NATNET = Input(
    "natnet",
    "NatNet: the server connects to OptiTrack Motive",
    NatNetOptions,
    _open,
    drop_reasons=("malformed", "not_allowed", "rate", "kernel", "unsupported"),
)
