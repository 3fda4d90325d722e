"""What the doctor says about the bodies that arrive, as Markdown for the page."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

from manipnet.page.markdown import escape

MOST: Final = 12
"""Findings that are shown; the worst come first."""
LONGEST: Final = 400
_MARKS: Final = {"problem": "⚠", "note": "○"}


def doctor_text(findings: Iterable[Mapping[str, Any]]) -> str:
    """The problems with their remedies, then the notes. What is in order is shown by the table of bodies."""
    worst = sorted(
        (finding for finding in findings if finding["level"] in _MARKS),
        key=lambda finding: list(_MARKS).index(finding["level"]),
    )
    if not worst:
        return "● What arrives is in order"
    lines = [_line(finding) for finding in worst[:MOST]]
    if len(worst) > MOST:
        lines.append(f"and {len(worst) - MOST} more: run `manipnet doctor`")
    return "\n\n".join(["**Doctor**", *lines])


def _line(finding: Mapping[str, Any]) -> str:
    text = f"{_MARKS[finding['level']]} {escape(finding['text'], LONGEST)}"
    return f"{text} → *{escape(finding['remedy'], LONGEST)}*" if finding["remedy"] else text
