"""What an avatar, to whose hands a client has subscribed, costs of a tick.

Two tick loops play the bundled demo in turns, one of them with an avatar whose hands are 15 % larger than the model's.
The result is the difference of their times, relative to a tick without encoding for clients.
"""

import argparse
import os
import time

import numpy as np

from benchmarks.support import scaled_profile
from manipnet.actors.avatar import Avatar
from manipnet.runtime.avatars import Avatars
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.telemetry import Telemetry
from manipnet.wire import HandsMessage, encode_binary
from manipnet_tools.bench.harness import TICK, TURN, TickRunner
from manipnet_tools.bench.scenarios import actor_names, demo


class Subscribed:
    """A client that wants every avatar, in one of the two encodings."""

    def wants(self, avatar: str) -> bool:
        return True

    def publish_avatar(self, message: HandsMessage, profile: HandProfile) -> None:
        encode_binary(message)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("turns", nargs="?", type=int, default=300, help=f"of {TURN} ticks each (default: %(default)d)")
    turns = parser.parse_args().turns
    bundle, scenario, avatars = load_bundle(), demo(), Avatars(Telemetry())
    avatars.audience = Subscribed()
    avatars.add(Avatar(scaled_profile(bundle.hand, whole=1.15), bundle.hand), actor_names(1)[0], stays=True)
    runners = [TickRunner(bundle, scenario), TickRunner(bundle, scenario, avatars=avatars)]
    load = os.getloadavg()[0]
    ticks_s, stages_s = np.empty((2, turns)), []
    for turn in range(turns):
        for k, runner in enumerate(runners):
            begin_s = time.perf_counter()
            spent = [runner.tick() for _ in range(TURN)]
            ticks_s[k, turn] = (time.perf_counter() - begin_s) / TURN
            stages_s += [sum(tick[stage] for stage in TICK) for tick in spent]
    tick_s, cost_s = float(np.median(stages_s)), float(np.median(ticks_s[1] - ticks_s[0]))
    print(f"load {load:.1f} on {os.cpu_count()} cores; a tick {1e3 * tick_s:.2f} ms; an avatar {1e3 * cost_s:.2f} ms,")
    print(f"{cost_s / tick_s:.2f} of a tick")


if __name__ == "__main__":
    main()
