"""A request of another program to begin or to end a recording, whatever protocol it came by."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class RecordTrigger:
    """A start or a stop, as its sender gave it."""

    starts: bool
    """Whether a recording is to begin; otherwise it is to end."""
    source: str
    """The sender, for example `osc:192.168.1.5:9000`."""
    name: str = ""
    """The name of the take; empty if the sender gives none."""
    about: Mapping[str, str] = field(default_factory=dict)
    """What else the sender says about the take, by keys of a recording's metadata, such as `notes` and `timecode`."""
    packet: str = ""
    """A text that only copies of the same packet share; empty if the protocol does not number its packets."""
