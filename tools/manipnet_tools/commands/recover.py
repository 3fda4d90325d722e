"""`manipnet recover`: copies everything that can be read from a recording that was cut off or damaged."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from manipnet.recording.mcap_file import BODIES, HANDS, recover
from manipnet_tools.terminal import open_console


@dataclass(frozen=True)
class RecoverOptions:
    """Repair a recording that has no end, for example after a crash or a power cut. The file itself is not changed."""

    recording: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RECORDING")]
    """The recording to read."""
    out: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """The file to write; it must not exist."""


def run(options: RecoverOptions) -> None:
    """Write what can be read. Raises `RecordingError` and `OSError`."""
    about = recover(options.recording, options.out)
    counts = f"{about.counts.get(BODIES, 0)} frames of bodies, {about.counts.get(HANDS, 0)} hands messages"
    state = "was complete" if about.whole else "was cut off or damaged"
    open_console().print(f"{options.recording} {state}; wrote {options.out}: {counts}")
