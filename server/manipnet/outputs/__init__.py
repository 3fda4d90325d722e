"""The protocols that send hands."""

from collections.abc import Callable
from typing import Any

from manipnet.common.options import ConfigError
from manipnet.net.errors import ListenError
from manipnet.outputs.declaration import Emission, HandsOutput, Output
from manipnet.outputs.livelink import LIVELINK
from manipnet.outputs.lsl import LSL
from manipnet.outputs.vmc import VMC
from manipnet.outputs.websocket import WEBSOCKET
from manipnet.outputs.zeromq import ZEROMQ

OUTPUTS: tuple[Output, ...] = (ZEROMQ, WEBSOCKET, VMC, LIVELINK, LSL)
"""A new protocol takes one file or folder in this package, and one entry in this tuple."""


def open_outputs(options_of: Callable[[type], Any], emission: Emission) -> dict[Output, HandsOutput]:
    """Open every output that its options, which `options_of` finds by their class, turn on.

    Raises `ListenError`, `KeyFileError` and `ConfigError`, and then nothing is open.
    """
    opened: dict[Output, HandsOutput] = {}
    try:
        for declared in OUTPUTS:
            options = options_of(declared.options)
            if declared.is_on(options):
                opened[declared] = declared.open(options, emission)
    except BaseException as error:
        for output in opened.values():
            output.close()
        if isinstance(error, ListenError | ConfigError):
            raise type(error)(f"{declared.where.flag}: {error}") from None
        raise
    return opened
