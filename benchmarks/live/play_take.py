"""Stream a take to a server in a loop, with times of this machine's monotonic clock.

With these times, a client on the same machine knows how old a hand is when it arrives; `manipnet replay` sends the
times of the take.
"""

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

from manipnet.inputs.playback import looped, play
from manipnet.wire.bodies import BodyFrame
from manipnet_tools.commands.replay import connect, take_frames
from manipnet_tools.takes.take import read_take


def stamped(frames: list[BodyFrame]) -> Iterator[BodyFrame]:
    """Repeat the frames without end, each with the time at which it is due; the first is due at once."""
    start_s = time.monotonic()
    for frame in looped(frames):
        yield frame._replace(t_s=start_s + frame.t_s - frames[0].t_s)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("take", type=Path)
    parser.add_argument("address", help="of the server's bodies, tcp://HOST:PORT")
    arguments = parser.parse_args()
    frames = list(take_frames(read_take(arguments.take)))
    play(stamped(frames), connect(arguments.address))


if __name__ == "__main__":
    main()
