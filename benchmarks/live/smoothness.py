"""How rough a display of the hands is beside the data: a table of the largest accelerations' ratios.

`python benchmarks/live/smoothness.py`. Input at 60 Hz, shown at 90 and 144 Hz, over a clean network and one that loses
5 % and delays by up to 20 ms; the worst of four seeds. All languages show the same within 2e-6, which tests see to.
"""

import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "tests" / "clients"), str(ROOT / "tests" / "support"), str(ROOT / "clients" / "python")]
from test_interpolation import RATE_HZ, play, roughest, source  # noqa: E402

SEEDS = range(4)
NETWORKS = {"clean": (0.0, 0.0005), "5 % lost, 20 ms jitter": (0.05, 0.020)}


def ratios(display_hz: int, lost: float, jitter_s: float, seed: int) -> list[float]:
    """Of a joint's position, an angle and a wrist's turn."""
    rng = np.random.default_rng(seed)
    x = source(1200, rng)
    shown = play(x, display_hz, rng.random(len(x)) >= lost, rng.uniform(0.0, jitter_s, len(x)))
    turns = [2 * np.arctan2(h.wrist[5], h.wrist[6]) for h in shown]
    curves = ([h.joints[4, 0] for h in shown], [h.angles[3] for h in shown], turns)
    return [roughest(curve, display_hz) / roughest(x, RATE_HZ) for curve in curves]


if __name__ == "__main__":
    print("| network | shown at | position | angle | turn |\n|---|---|---|---|---|")
    for network, (lost, jitter_s) in NETWORKS.items():
        for display_hz in (90, 144):
            worst = np.max([ratios(display_hz, lost, jitter_s, seed) for seed in SEEDS], axis=0)
            print(f"| {network} | {display_hz} Hz | {' | '.join(f'{ratio:.2f}' for ratio in worst)} |")
