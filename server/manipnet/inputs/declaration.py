"""How a protocol that delivers tracked bodies declares itself; `manipnet.inputs.INPUTS` lists the declarations.

The command line, the rig file, the counters, `manipnet doctor`, `manipnet rig init`, `manipnet replay`, the `ready`
line and the documentation read them. A module with a declaration loads at `--help`, so it imports heavy libraries only
inside `open` and `player`.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from manipnet.common.options import Network, Protocol

if TYPE_CHECKING:
    from manipnet.inputs.base import Intake, Sink
    from manipnet.inputs.playback import BodySender
    from manipnet.net.curve_keys import ServerKeys
    from manipnet.telemetry import Gauge, Telemetry
    from manipnet.wire.record_trigger import RecordTrigger


@dataclass(frozen=True, slots=True)
class Reception:
    """What every receiver needs of the server."""

    intake: "Intake"
    """Takes the frames that arrive and counts those that are dropped."""
    host: str = "127.0.0.1"
    """The address of this machine to listen on."""
    keys: "ServerKeys | None" = None
    """The keys that senders must have where a protocol knows keys."""
    allow: tuple[Network, ...] = ()
    """The networks that may send; empty if any may."""
    bodies: frozenset[int | str] = frozenset()
    """The bodies of the rig by id or name. They help to read names that are not written in UTF-8."""
    record: "Callable[[RecordTrigger], object] | None" = None
    """Takes the triggers of recordings that arrive among the bodies; None if nothing is recorded."""


class Receiver:
    """Receives tracked bodies by one protocol, from `start` until `stop`."""

    address: str
    """Where it listens, or what it connects to. After `start`, the port is the real one."""

    def start(self) -> None:
        """Begin to receive, on a thread of its own. Raises `ListenError`."""
        raise NotImplementedError

    def stop(self) -> None:
        """Stop receiving and free the port. Does nothing if the receiver was not started."""
        raise NotImplementedError

    def connected(self) -> int | None:
        """The number of senders that are connected, or None for a protocol without connections. From any thread."""
        return None

    def status(self) -> Mapping[str, Any] | None:
        """What the request `status` reports about this receiver, or None. From any thread."""
        return None

    def gauges(self) -> "Iterable[Gauge]":
        """Measurements for the metrics page. From any thread."""
        return ()


@dataclass(frozen=True)
class Input(Protocol):
    """A protocol that delivers tracked bodies. The `source` of each of its frames is its name, a colon, the sender."""

    open: Callable[[Any, Reception], Receiver]
    """Make a receiver, which is not started yet, from an instance of `options`."""
    drop_reasons: tuple[str, ...] = ("malformed",)
    """Why its receiver may drop a message, as labels of the counter `frames_dropped`."""
    transport: Literal["tcp", "udp"] | None = None
    """The kind of port it listens on; None if it connects to the sender."""
    scheme: str = ""
    """The scheme of its addresses in `manipnet replay --to`, if that is not `name`."""
    player: "Callable[[str, int], BodySender] | None" = None
    """Make the sender with which `manipnet replay` plays a take to a host and port; None if it cannot."""

    def intake(self, sink: "Sink", telemetry: "Telemetry") -> "Intake":
        """The intake of a receiver whose frames go to `sink`."""
        from manipnet.inputs.base import Intake

        return Intake(self.name, self.drop_reasons, sink, telemetry)
