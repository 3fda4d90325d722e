"""Triggers of recordings over OSC: `/record/start "name"` and `/record/stop`."""

from typing import Final

from manipnet.inputs.osc.packet import Packet, read_address, read_arguments
from manipnet.wire.bodies import MessageError
from manipnet.wire.record_trigger import RecordTrigger

START: Final = b"/record/start\0"
STOP: Final = b"/record/stop\0"
_PREFIX: Final = b"/record/st"


def take_triggers(packet: Packet, source: str) -> tuple[Packet, list[RecordTrigger]]:
    """The triggers in a packet, and the packet without them. A trigger that is malformed becomes a fault."""
    if not any(message.startswith(_PREFIX) for _, message in packet.messages):
        return packet, []
    rest, triggers, faults = [], [], list(packet.faults)
    for tag, message in packet.messages:
        if not message.startswith((START, STOP)):
            rest.append((tag, message))
            continue
        try:
            triggers.append(_trigger(message, source))
        except MessageError as error:
            faults.append(str(error))
    return Packet(rest, faults), triggers


def _trigger(message: bytes, source: str) -> RecordTrigger:
    """The trigger of a message: the first argument is the name of the take, the second a note; both may be missing."""
    _, offset = read_address(message)
    words = [word if isinstance(word, str) else f"{word:g}" for word in _plain(read_arguments(message, offset))]
    about = {"notes": words[1]} if len(words) > 1 else {}
    return RecordTrigger(message.startswith(START), source, words[0] if words else "", about)


def _plain(arguments: tuple) -> list[str | float]:
    """The texts and numbers among the arguments."""
    return [each for each in arguments if isinstance(each, str | int | float) and not isinstance(each, bool)]
