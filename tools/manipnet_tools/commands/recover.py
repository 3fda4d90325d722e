"""`manipnet recover`: copies everything that can be read from a recording that was cut off or damaged."""

import os

from manipnet.recording.mcap_file import BODIES, HANDS, recover
from manipnet_tools.commands.options import RecoverOptions
from manipnet_tools.terminal import open_console


def run(options: RecoverOptions) -> None:
    """Write what can be read. Raises `RecordingError` and `OSError`, and then no file has changed."""
    part = options.out.with_name(f".{options.out.name}.{os.getpid()}.part")
    try:
        about = recover(options.recording, part)
        part.replace(options.out)
    finally:
        part.unlink(missing_ok=True)
    counts = f"{about.counts.get(BODIES, 0)} frames of bodies, {about.counts.get(HANDS, 0)} hands messages"
    state = "was complete" if about.whole else "was cut off or damaged"
    open_console().print(f"{options.recording} {state}; wrote {options.out}: {counts}")
