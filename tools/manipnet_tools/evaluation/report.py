"""The results of an evaluation as tables and as JSON."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from manipnet.geometry import SIDES
from manipnet_tools.evaluation.realism import Realism
from manipnet_tools.evaluation.results import CAPTURED, Results
from manipnet_tools.evaluation.scoring import TARGETS, Score

MEASURES = {
    "drop_right": ("drop test, right alone, %", "{:.0f}", 100.0),
    "drop_left": ("drop test, left alone, %", "{:.0f}", 100.0),
    "drop_both": ("drop test, both hands, %", "{:.0f}", 100.0),
    "physics": ("physics, %", "{:.1f}", 100.0),
    "physics_paper": ("paper's physics, %", "{:.1f}", 100.0),
    "ratio": ("error ratio, near", "{:.2f}", 1.0),
    "near_mm": ("error near, mm", "{:.1f}", 1.0),
    "mpjpe_mm": ("MPJPE, mm", "{:.1f}", 1.0),
    "tip_mm": ("fingertips, mm", "{:.1f}", 1.0),
    "drift_s": ("longest drift, s", "{:.1f}", 1.0),
    "contact_f1": ("contact F1", "{:.2f}", 1.0),
    "contact_f1_many": ("contact F1, one to many", "{:.2f}", 1.0),
    "finger_recall": ("recall of touching fingers", "{:.2f}", 1.0),
    "touching": ("touching capsules, held", "{:.1f}", 1.0),
    "touching_ratio": ("touching capsules ratio", "{:.2f}", 1.0),
    "penetration_cm": ("penetration, cm", "{:.3f}", 1.0),
    "over_1cm": ("over 1 cm deep, %", "{:.1f}", 100.0),
    "deep": ("deep frames, %", "{:.1f}", 100.0),
    "self_mm": ("fingers overlap, mm", "{:.1f}", 1.0),
    "self_95_mm": ("fingers overlap, 95 %, mm", "{:.1f}", 1.0),
    "slide_mm_s": ("sliding tips, mm/s", "{:.0f}", 1.0),
    "slide_ratio": ("slide ratio", "{:.2f}", 1.0),
    "smoothness": ("smoothness, cm/s²", "{:.0f}", 1.0),
    "smoothness_ratio": ("smoothness ratio", "{:.2f}", 1.0),
    "idle_ratio": ("idle smoothness ratio", "{:.2f}", 1.0),
    "idle_energy": ("idle energy ratio", "{:.2f}", 1.0),
    "opening_mm": ("opening before contact, mm", "{:.0f}", 1.0),
    "opening_ratio": ("opening ratio", "{:.2f}", 1.0),
    "opening_s": ("opening before contact, s", "{:.2f}", 1.0),
}
"""The label, format and factor of each measure of a score."""
REALISM = {
    "auc": ("classifier AUC", "{:.2f}", 1.0),
    "frechet": ("Fréchet distance", "{:.1f}", 1.0),
    "precision": ("precision", "{:.2f}", 1.0),
    "recall": ("recall", "{:.2f}", 1.0),
}
"""Likewise of realism."""
MAX_COLUMNS = 8


def tables(results: Results, ours: str, compared: dict[str, Realism]) -> Iterator[Table]:
    """Tables of the averages of every row, of the rows' realism, and of `ours` against its targets and for every take.

    A table without figures is left out.
    """
    averages = {name: row.average for name, row in results.rows.items()}
    whole = [table_of(f"{results.protocol}: averages over takes and both hands", averages)]
    if compared:
        whole.append(table_of(f"{results.protocol}: told from captured hands", compared, REALISM))
    whole += [_verdicts(results, ours), *_by_take(results, ours)]
    yield from (table for table in whole if table.row_count)


def _by_take(results: Results, ours: str) -> Iterator[Table]:
    for side in SIDES:
        takes = {take: sides[side] for take, sides in results.rows[ours].scores.items()}
        yield table_of(f"{results.protocol}: {ours}, {side} hand", takes)


def table_of(
    title: str, scores: Mapping[str, Score | Realism], measures: dict[str, tuple[str, str, float]] = MEASURES
) -> Table:
    """A table with a column per score, of which every n-th is shown if there are many, and a line per measure that any
    of them has."""
    names = list(scores)
    names = names[:: -(-len(names) // MAX_COLUMNS)]
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 0, 0, 1), pad_edge=False)
    table.add_column("", no_wrap=True)
    for name in names:
        table.add_column(name, justify="right")
    for measure, (label, form, factor) in measures.items():
        values = [getattr(scores[name], measure) for name in names]
        if any(map(math.isfinite, values)):
            table.add_row(label, *(_cell(value, form, factor) for value in values))
    return table


def _cell(value: float, form: str, factor: float) -> str:
    return form.format(factor * value) if math.isfinite(value) else "-"


def _verdicts(results: Results, ours: str) -> Table:
    table = Table(
        "target", "bound", ours, "verdict", title=f"{results.protocol}: targets", title_justify="left", box=SIMPLE_HEAD
    )
    for verdict in verdicts(results, ours):
        met = Text("met", "green") if verdict["met"] else Text("missed", "red")
        table.add_row(verdict["text"], verdict["target"], f"{verdict['value']:.3f}", met)
    return table


def verdicts(results: Results, ours: str) -> list[dict[str, Any]]:
    """Each target of the protocol with the value of the row `ours` and whether it is met."""
    score, captured = results.rows[ours].average, results.rows[CAPTURED].average
    return [
        {
            "measure": target.measure,
            "text": target.text,
            "target": _bounds(target.low, target.high),
            "value": target.value(score, captured),
            "met": target.met(score, captured),
        }
        for target in TARGETS[results.protocol]
        if math.isfinite(getattr(score, target.measure))
    ]


def _bounds(low: float, high: float) -> str:
    if low in (0.0, -math.inf):
        return f"≤ {high:g}"
    return f"≥ {low:g}" if high in (1.0, math.inf) else f"{low:g} to {high:g}"


def as_json(results: Results, ours: str, compared: dict[str, Realism]) -> dict[str, Any]:
    """All measures as plain data; null if a case has no frames of a kind."""
    return {
        "protocol": results.protocol,
        "ours": ours,
        "verdicts": verdicts(results, ours),
        "realism": plain(compared),
        "rows": {
            name: {
                "average": plain(row.average),
                "takes": {take: plain(sides) for take, sides in row.scores.items()},
            }
            for name, row in results.rows.items()
        },
    }


def plain(value: Any) -> Any:
    """Scores and realism as dictionaries, not-a-number as null."""
    if isinstance(value, Score | Realism):
        value = asdict(value)
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
