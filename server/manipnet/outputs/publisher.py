"""Publishes the hands through every output that is turned on. Belongs to the tick thread, and nothing here waits."""

import logging
from collections.abc import Collection, Mapping
from typing import Protocol

from manipnet.outputs.declaration import EncodedHands, HandsOutput, Output
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.telemetry import Telemetry
from manipnet.wire import HandsMessage

_log = logging.getLogger(__name__)


class Tape(Protocol):
    """Records what is published, while `is_recording`. Its methods return at once."""

    @property
    def is_recording(self) -> bool: ...

    def note(self, payload: bytes) -> None: ...

    def note_avatar(self, payload: bytes, profile: HandProfile) -> None: ...


class Publisher:
    """Encodes each hands message once and gives it to all outputs."""

    def __init__(
        self,
        outputs: Mapping[Output, HandsOutput],
        telemetry: Telemetry,
        tape: Tape | None = None,
        taped: Collection[str] = (),
    ) -> None:
        """`tape` records what is published, and the avatars `taped` even if nobody receives them.

        `close` closes the outputs.
        """
        self._outputs = dict(outputs)
        self._tape, self._taped = tape, frozenset(taped)
        for declared in outputs:
            telemetry.declare("messages_out", *declared.labels)
        self._counters = {
            declared.name: [telemetry.counter("messages_out", topic=topic) for topic in declared.labels]
            for declared in outputs
        }

    @property
    def addresses(self) -> dict[str, str]:
        """Where the outputs listen, by their names in the `ready` line."""
        return {declared.title: output.address for declared, output in self._outputs.items() if output.address}

    def connected(self) -> dict[str, int]:
        """The number of clients of each output that has connections. From any thread."""
        counts = {declared.title: output.connected() for declared, output in self._outputs.items()}
        return {title: count for title, count in counts.items() if count is not None}

    def publish(self, message: HandsMessage) -> None:
        """Send one message to everybody. Raises `MessageError` for a message that breaks the protocol's rules."""
        hands = EncodedHands(message)
        if self._tape is not None and self._tape.is_recording:
            self._tape.note(hands.msgpack)
        for declared, output in self._outputs.items():
            try:
                if output.send(hands):
                    for count in self._counters[declared.name]:
                        count()
            except OSError as error:
                _log.warning("%s: hands cannot be sent: %s", declared.name, error)

    def wants(self, avatar: str) -> bool:
        """Whether anybody receives or records the hands of an avatar, by the name of its profile."""
        is_taped = avatar in self._taped and self._tape is not None and self._tape.is_recording
        return is_taped or any(output.wants(avatar) for output in self._outputs.values())

    def publish_avatar(self, message: HandsMessage, profile: HandProfile) -> None:
        """Send the hands of an avatar, whose profile is given. Raises `MessageError` as `publish` does."""
        hands = EncodedHands(message)
        if self._tape is not None and self._tape.is_recording:
            self._tape.note_avatar(hands.msgpack, profile)
        for declared, output in self._outputs.items():
            try:
                if output.send_avatar(hands, profile):
                    for count in self._counters[declared.name]:
                        count()
            except OSError as error:
                _log.warning("%s: an avatar's hands cannot be sent: %s", declared.name, error)

    def close(self) -> None:
        """Close every output. Does nothing the second time."""
        while self._outputs:
            _, output = self._outputs.popitem()
            output.close()
