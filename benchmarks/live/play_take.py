"""Stream a take to a server in real time, for ever, stamped with this machine's monotonic clock.

`python benchmarks/live/play_take.py TAKE tcp://HOST:PORT`. `manipnet replay` sends a take's own times; with these,
whoever receives a hand on the same machine knows how old it is.
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from manipnet.inputs.playback import looped, play
from manipnet.wire.bodies import BodyFrame
from manipnet_tools.commands.replay import connect, take_frames
from manipnet_tools.takes.take import read_take


def stamped(frames: list[BodyFrame]) -> Iterator[BodyFrame]:
    """The frames over and over, each at the time it is due; the first is due at once."""
    start_s = time.monotonic()
    for frame in looped(frames):
        yield replace(frame, t_s=start_s + frame.t_s - frames[0].t_s)


if __name__ == "__main__":
    path, address = sys.argv[1:]
    take = list(take_frames(read_take(Path(path))))
    play(stamped(take), connect(address))
