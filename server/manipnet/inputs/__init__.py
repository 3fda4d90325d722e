"""The protocols that deliver tracked bodies."""

from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from manipnet.common.options import Network
from manipnet.inputs.declaration import Input, Receiver, Reception
from manipnet.inputs.natnet import NATNET
from manipnet.inputs.osc import OSC
from manipnet.inputs.zeromq import ZEROMQ
from manipnet.net.errors import ListenError

if TYPE_CHECKING:
    from manipnet.inputs.base import Sink
    from manipnet.net.curve_keys import ServerKeys
    from manipnet.telemetry import Telemetry
    from manipnet.wire.record_trigger import RecordTrigger

INPUTS: tuple[Input, ...] = (ZEROMQ, OSC, NATNET)
"""A new protocol takes one file or folder in this package, and one entry in this tuple."""


def make_receivers(
    options_of: Callable[[type], Any],
    sink: "Sink",
    telemetry: "Telemetry",
    host: str,
    keys: "ServerKeys | None" = None,
    allow: tuple[Network, ...] = (),
    bodies: frozenset[int | str] = frozenset(),
    record: "Callable[[RecordTrigger], object] | None" = None,
) -> dict[Input, Receiver]:
    """A receiver for every input that its options, which `options_of` finds by their class, turn on.

    The receivers are not started yet. Their frames go to `sink`; see `Reception` for the other arguments.
    """
    made: dict[Input, Receiver] = {}
    for declared in INPUTS:
        options = options_of(declared.options)
        if declared.is_on(options):
            reception = Reception(declared.intake(sink, telemetry), host, keys, allow, bodies, record)
            made[declared] = declared.open(options, reception)
            telemetry.add_gauges(made[declared].gauges)
    return made


def start_receivers(receivers: dict[Input, Receiver], opened: ExitStack) -> None:
    """Start every receiver; `opened` stops them again. Raises `ListenError` and `KeyFileError`."""
    for declared, receiver in receivers.items():
        try:
            receiver.start()
        except ListenError as error:
            raise ListenError(f"{declared.where.flag}: {error}") from None
        opened.callback(receiver.stop)
