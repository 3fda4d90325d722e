"""How rough a display of the hands is compared with the data: a table of ratios of the largest accelerations.

The data arrive at 60 Hz and are shown at 90 and 144 Hz, over a clean network and over one that loses 5 % of the frames
and delays the others by up to 20 ms; the table shows the worst of four seeds. The tests ensure that the clients of all
languages show the same within 2e-6.
"""

import argparse

import numpy as np

from benchmarks.support import RATE_HZ, peak_acceleration, play, source, turn_about_z

SEEDS = range(4)
NETWORKS = {"clean": (0.0, 0.0005), "5 % lost, 20 ms jitter": (0.05, 0.020)}


def ratios(display_hz: int, lost: float, jitter_s: float, seed: int) -> list[float]:
    """The ratios for the position of a joint, an angle, and the turn of a wrist."""
    rng = np.random.default_rng(seed)
    x = source(1200, rng)
    shown = play(x, display_hz, rng.random(len(x)) >= lost, rng.uniform(0.0, jitter_s, len(x)))
    curves = [h.joints[4, 0] for h in shown], [h.angles[3] for h in shown], [turn_about_z(h) for h in shown]
    return [peak_acceleration(curve, display_hz) / peak_acceleration(x, RATE_HZ) for curve in curves]


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    print("| network | shown at | position | angle | turn |\n|---|---|---|---|---|")
    for network, (lost, jitter_s) in NETWORKS.items():
        for display_hz in (90, 144):
            worst = np.max([ratios(display_hz, lost, jitter_s, seed) for seed in SEEDS], axis=0)
            print(f"| {network} | {display_hz} Hz | {' | '.join(f'{ratio:.2f}' for ratio in worst)} |")


if __name__ == "__main__":
    main()
