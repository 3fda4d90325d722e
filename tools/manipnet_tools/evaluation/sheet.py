"""Picture sheets for judging by eye: captured and synthesised grasps side by side, in random order."""

from pathlib import Path

import numpy as np

from manipnet.geometry import SIDES
from manipnet_tools.evaluation import metrics
from manipnet_tools.evaluation.pictures import grasp_picture
from manipnet_tools.evaluation.results import CAPTURED, Results
from manipnet_tools.rendering import contact_sheet, save_png

PAIRS_PER_HAND = 3
COLUMNS = 4
"""Two pairs in a row of the sheet."""


def write_sheet(results: Results, ours: str, path: Path, rng: np.random.Generator | None = None) -> Path:
    """Write pairs of pictures to `path` and the key to `path` with the suffix `.key.txt`, which is returned.

    Each pair shows one frame in which a captured hand holds the lifted object, as captured and as in the row `ours`, in
    an order that `rng` draws.
    """
    rng = rng or np.random.default_rng()
    pictures, key = [], [f"captured fingers in each pair; the other picture is {ours}"]
    for take, case in results.cases.items():
        for side in SIDES:
            held = case.lifted & metrics.settled(len(case)) & (case.gaps[side].closest < metrics.CONTACT_M)
            frames = np.flatnonzero(held)
            for frame in sorted(rng.choice(frames, min(PAIRS_PER_HAND, len(frames)), replace=False).tolist()):
                hands = [results.rows[name].hands[take][side][frame] for name in (CAPTURED, ours)]
                second = bool(rng.integers(2))
                pictures += [
                    grasp_picture(case, side, hand, frame, mark=False) for hand in (hands[::-1] if second else hands)
                ]
                key.append(f"pair {len(key)}: {'right' if second else 'left'}   {take}, {side} hand, tick {frame}")
    save_png(contact_sheet(pictures, COLUMNS), path)
    answers = path.with_suffix(".key.txt")
    answers.write_text("\n".join(key) + "\n", encoding="utf-8")
    return answers
