"""Pieces of HTML for the panel and the stage. Whatever comes from others is escaped, so it shows as text."""

import html
from collections.abc import Iterable, Mapping
from typing import Any, Final

from manipnet.page.overlays import Layer
from manipnet.page.state import Verdict, ago

DOTS: Final = {"good": "●", "notice": "○", "bad": "○"}
MOST: Final = 3
"""Findings of the doctor that the stage shows; the panel *Health* has all of them."""
ELSEWHERE: Final = "see the other findings"
"""A remedy that begins like this only points to another finding."""
_LONGEST: Final = 240


def text(value: object, most: int = _LONGEST) -> str:
    """A value as HTML that shows exactly its text, at most `most` characters of it."""
    shown = str(value)
    return html.escape(shown if len(shown) <= most else shown[: most - 1] + "…")


def state_line(state: Verdict, detail: str) -> str:
    """The headline of the panel."""
    return (
        f'<div class="mn-state mn-{state.level}"><b>{DOTS[state.level]} {text(state.text)}</b>'
        f"<span>{text(detail)}</span></div>"
    )


def take_line(name: str, seconds: float) -> str:
    """The headline while a take is shown."""
    return f'<div class="mn-state mn-take"><b>▶ {text(name)}</b><span>{clock(seconds)} · live goes on</span></div>'


def recording_mark(now: Mapping[str, Any] | None) -> str:
    """The red frame around the stage while a recording is in progress, with its elapsed time."""
    if now is None:
        return ""
    elapsed = clock(now["seconds"])
    return f'<div class="mn-recording"><b>● REC {elapsed}</b><i>{text(now["name"].removesuffix(".mcap"), 48)}</i></div>'


def clock(seconds: float) -> str:
    """Seconds as minutes and seconds."""
    return f"{int(seconds) // 60}:{int(seconds) % 60:02}"


def legend(layer: Layer) -> str:
    """The colours of a layer and what it means."""
    swatches = "".join(f'<i style="background:rgb{color}"></i>' for color in layer.colors)
    return f'<div class="mn-legend">{swatches}<span>{text(layer.meaning)}</span></div>'


def card(state: Verdict, status: Mapping[str, Any]) -> str:
    """What the stage says in its middle while nothing arrives: for what it waits, where, and what the doctor finds."""
    parts = [f'<div class="mn-card mn-{state.level}"><h2>{text(state.text)}</h2>']
    listening = status.get("listening", {})
    if listening:
        rows = "".join(
            f"<tr><td>{text(name)}</td><td><code>{text(at)}</code></td></tr>" for name, at in listening.items()
        )
        parts.append(f"<p>The server listens at</p><table>{rows}</table>")
    parts.append("<p>and needs these bodies</p><table>")
    problems = [finding for finding in status.get("doctor", ()) if finding["level"] == "problem"]
    of_parts = {part: _about_part(part, problems) for part, _ in _bodies(status)}
    parts += [_body_row(part, body, of_parts[part]) for part, body in _bodies(status)]
    parts.append("</table>")
    general = [finding for finding in problems if not any(finding in each for each in of_parts.values())]
    parts += [_finding(finding) for finding in general[:MOST]]
    return "".join([*parts, "</div>"])


def _bodies(status: Mapping[str, Any]) -> Iterable[tuple[str, Mapping[str, Any]]]:
    for name, actor in status["actors"].items():
        for part, body in actor["bodies"].items():
            yield (f"{name}: {part}" if len(status["actors"]) > 1 else part), body


def _about_part(part: str, problems: list[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """What the doctor finds about one wrist or prop."""
    return [finding for finding in problems if finding["text"].startswith(f"{part}: ")]


def _body_row(part: str, body: Mapping[str, Any], problems: list[Mapping[str, Any]]) -> str:
    """A wrist or prop, the body that it needs, when this was seen, and a hint if other bodies arrive."""
    key = body["body"]
    wanted = f"the body {key!r}" if isinstance(key, str) else f"the body with id {key}"
    seen = "has not arrived yet" if body["age_s"] is None else f"came {ago(body['age_s'])}"
    hints = "".join(f"<em>{text(each['remedy'])}</em>" for each in problems if not each["remedy"].startswith(ELSEWHERE))
    return f"<tr><td>{text(part)}</td><td>{text(wanted)}{hints}</td><td>{seen}</td></tr>"


def _finding(finding: Mapping[str, Any]) -> str:
    remedy = f"<em>{text(finding['remedy'])}</em>" if finding["remedy"] else ""
    return f'<p class="mn-finding">{text(finding["text"])}{remedy}</p>'
