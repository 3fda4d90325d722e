"""Plots of an evaluation: the error over time, the contacts over time, and pictures of the worst frames."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from manipnet.geometry import Array, Side
from manipnet.synthesis.hand.hand import Hand
from manipnet_tools.evaluation import metrics
from manipnet_tools.evaluation.cases import Case
from manipnet_tools.evaluation.pictures import grasp_picture
from manipnet_tools.evaluation.results import Results
from manipnet_tools.evaluation.scoring import Score
from manipnet_tools.rendering import (
    Image,
    contact_sheet,
    save_png,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PRESSED = (0.78, 0.16, 0.12)
PICTURE = (420, 420)


def write_all(results: Results, ours: str, folder: Path) -> Iterator[Path]:
    """Write every plot into `folder`, which is created if it does not exist; yields each file when it is written."""
    folder.mkdir(parents=True, exist_ok=True)
    for case in results.cases.values():
        hands = {name: row.hands[case.name] for name, row in results.rows.items()}
        for kind, figure in (
            ("error", _error_over_time(case, {k: v for k, v in hands.items() if v is not case.captured})),
            ("contacts", _contact_strips(case, hands[ours])),
        ):
            path = folder / f"{results.protocol}-{case.name}-{kind}.png"
            figure.savefig(path, dpi=110)
            yield path
    path = folder / f"{results.protocol}-worst-frames.png"
    save_png(_worst_frames(results, ours), path)
    yield path


def write_sweep(name: str, rows: dict[str, Score], folder: Path) -> Path:
    """Plot joint error and contacts at every step of a sweep; writes `sweep-NAME.png` into `folder` and returns it."""
    from matplotlib.figure import Figure

    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    errors, contacts = figure.subplots(1, 2)
    for label, measure in (("all joints", "mpjpe_mm"), ("near the object", "near_mm"), ("fingertips", "tip_mm")):
        errors.plot(list(rows), [getattr(score, measure) for score in rows.values()], marker="o", label=label)
    contacts.plot(list(rows), [score.contact_f1 for score in rows.values()], marker="o", color="tab:green")
    for axes, what in ((errors, "error, mm"), (contacts, "contact F1")):
        axes.set_ylabel(what)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel(name)
        axes.tick_params(axis="x", rotation=30)
        axes.grid(alpha=0.3)
    errors.legend()
    path = folder / f"sweep-{name}.png"
    figure.savefig(path, dpi=110)
    return path


def _figure(case: Case, height: float) -> "tuple[Figure, list[tuple[Side, Axes]]]":
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, height), layout="constrained")
    axes = figure.subplots(len(case.captured), 1, sharex=True)
    axes[-1].set_xlabel("time, s")
    return figure, list(zip(case.captured, axes, strict=True))


def _error_over_time(case: Case, rows: dict[str, dict[Side, Array]]) -> "Figure":
    figure, panels = _figure(case, 6.0)
    time = case.ticks.time_s
    for side, axes in panels:
        near = metrics.near(case.gaps[side])
        axes.fill_between(time, 0, 1, where=near.tolist(), transform=axes.get_xaxis_transform(), color="0.92")
        for name, hands in rows.items():
            axes.plot(time, 1e3 * metrics.joint_error_m(hands[side], case.captured[side]), lw=0.9, label=name)
        axes.set(
            title=f"{case.name}, {side} hand (shaded: near the object)",
            ylabel="joint error, mm",
            ylim=(0, None),
        )
    panels[0][1].legend(loc="upper right", fontsize="small", ncols=len(rows))
    return figure


def _contact_strips(case: Case, hands: dict[Side, Array]) -> "Figure":
    """For each capsule and frame: grey if both hands touch, orange if only the captured one, blue if only ours."""
    figure, panels = _figure(case, 8.0)
    names = _capsule_names(case.hand)
    colors = np.array([(1, 1, 1), (0.95, 0.6, 0.1), (0.15, 0.45, 0.85), (0.55, 0.55, 0.55)])
    for side, axes in panels:
        captured = case.gaps[side].gap < metrics.CONTACT_M
        ours = case.gaps_of(side, hands[side]).gap < metrics.CONTACT_M
        time = case.ticks.time_s
        axes.imshow(
            colors[captured.T + 2 * ours.T],
            aspect="auto",
            interpolation="nearest",
            extent=(time[0], time[-1], len(names) - 0.5, -0.5),
        )
        axes.set_yticks(range(len(names)), names, fontsize=7)
        axes.set_title(f"{case.name}, {side} hand: grey both touch, orange only captured, blue only synthesised")
    return figure


def _capsule_names(hand: Hand) -> list[str]:
    names = [
        f"PALM to {hand.joint_names[end]}" if start == 0 else hand.joint_names[start] for start, end in hand.capsules
    ]
    return [name.lower().replace("_", " ") for name in names]


def _worst_frames(results: Results, ours: str) -> Image:
    """The frame near the object with the largest joint error, of every take and hand: captured, then ours."""
    pictures: list[Image] = []
    for case in results.cases.values():
        for side, positions in results.rows[ours].hands[case.name].items():
            error = metrics.joint_error_m(positions, case.captured[side])
            error[~(metrics.near(case.gaps[side]) & metrics.settled(len(case)))] = 0.0
            frame = int(error.argmax())
            if error[frame] > 0.0:
                pictures += [grasp_picture(case, side, hand[frame], frame) for hand in (case.captured[side], positions)]
    return contact_sheet(pictures, columns=4)
