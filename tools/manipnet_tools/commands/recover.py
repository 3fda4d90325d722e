"""`manipnet recover`: a recording that was cut off or damaged, written anew with all that can be read."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from manipnet.recording.mcap_file import BODIES, HANDS, recover


@dataclass(frozen=True)
class RecoverOptions:
    """Mend a recording whose end is missing, after a crash or a power cut. The file itself is left alone."""

    recording: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RECORDING")]
    """The recording to read."""
    out: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """The file to write; it must not exist."""


def run(options: RecoverOptions) -> None:
    """Write what can be read. Raises `RecordingError` and `OSError`."""
    about = recover(options.recording, options.out)
    counts = f"{about.counts.get(BODIES, 0)} frames of bodies, {about.counts.get(HANDS, 0)} hands messages"
    was = "was whole" if about.whole else "was cut off or damaged"
    Console(stderr=True).print(f"{options.recording} {was}; wrote {options.out}: {counts}")
