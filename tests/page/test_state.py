"""What the page says about a session: state, rate and age never contradict each other."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_serialization import message

from manipnet.page import html
from manipnet.page.charts import NO_VALUE, SPAN_S, STEP_S, History
from manipnet.page.refusals import REASONS, refusals_text
from manipnet.page.state import duration, verdict
from manipnet.telemetry import LABELS


def status(paused: bool = False, **ages: float | None) -> dict[str, Any]:
    bodies = {part: {"age_s": age_s, "body": part, "state": "live", "rate_hz": 1.0} for part, age_s in ages.items()}
    return {"actors": {"actor": {"paused": paused, "bodies": bodies, "hands": {}}}}


@pytest.mark.parametrize(
    ("report", "level", "text"),
    [
        (status(left_wrist=0.01, right_wrist=0.01), "good", "Live"),
        (status(left_wrist=None, right_wrist=None), "notice", "Waiting for bodies"),
        (status(left_wrist=530.0, right_wrist=530.2), "bad", "No bodies for 530 s"),
        (status(left_wrist=1.4, right_wrist=1.2), "bad", "No bodies for 1 s"),
        (status(left_wrist=0.01, right_wrist=3.0), "bad", "right_wrist is lost for 3 s"),
        (status(left_wrist=0.01, right_wrist=None), "notice", "Live without right_wrist"),
        (status(True, left_wrist=0.01, right_wrist=0.01), "notice", "Paused"),
        (status(True, left_wrist=700.0, right_wrist=700.0), "bad", "No bodies for 12 min"),
    ],
)
def test_the_headline_says_what_is_the_case(report: dict[str, Any], level: str, text: str) -> None:
    state = verdict(report, 60.0)
    assert (state.level, state.text) == (level, text)


@pytest.mark.parametrize(("hands_hz", "level"), [(0.0, "good"), (9.0, "notice"), (40.0, "notice"), (58.0, "good")])
def test_hands_that_stutter_are_not_in_order(hands_hz: float, level: str) -> None:
    assert verdict(status(left_wrist=0.01, right_wrist=0.01), hands_hz).level == level


def test_durations_are_read_at_a_glance() -> None:
    assert [duration(s) for s in (0.012, 5.0, 530.0, 1800.0, 90_000.0)] == ["12 ms", "5 s", "530 s", "30 min", "25 h"]


def published(seq: int, t_s: float):
    return replace(message(), seq=seq, t_publish=t_s)


def test_the_rate_is_zero_once_nothing_comes_and_a_gap_stays_a_gap() -> None:
    history = History()
    for k in range(120):
        history.note(published(k, 100.0 + k / 60))
    assert history.rate_hz(102.0) == pytest.approx(60.0)
    assert history.rate_hz(104.0) == 0.0
    for k in range(120):
        history.note(published(120 + k, 110.0 + k / 60))
    columns = history.columns(112.0)
    inside = (columns["t"] > -9.5) & (columns["t"] < -2.5)
    assert not inside.any(), "a line across the gap has no point in it"
    edges = columns["rate"][(columns["t"] > -10.1) & (columns["t"] < -1.9)]
    assert (edges[1:3] == 0.0).all()
    assert (columns["total"] == NO_VALUE).sum() == 4, "the gap before everything, and the one in the middle"
    assert columns["rate"].max() == pytest.approx(60.0), "a pause is not a slow step"
    assert columns["t"].min() >= -SPAN_S
    assert np.diff(columns["t"]).min() >= 0.0
    assert STEP_S < 1.0


def test_an_empty_chart_has_a_span() -> None:
    columns = History().columns(5.0)
    assert columns["t"].tolist() == pytest.approx([-SPAN_S, 0.0], abs=2e-3)
    assert columns["rate"].tolist() == [0.0, 0.0]


def drop(count: int, age_s: float) -> dict[str, float]:
    return {"count": count, "rate_hz": 0.0, "age_s": age_s}


def test_refusals_have_reason_and_age_and_a_jump_of_a_loop_is_none() -> None:
    text = refusals_text({"frames_dropped": {"late": drop(7, 90.0)}, "bodies_rejected": {"jump": drop(48, 3.0)}})
    assert "| 7 | frames that came too late | 90 s ago |" in text
    assert "48" not in text
    assert "jumped to another place 3 s ago" in text
    looped = refusals_text({"bodies_rejected": {"jump": drop(48, 3.0)}})
    assert looped.startswith("Nothing was refused.")
    assert refusals_text({}) == "Nothing was refused."


def test_every_reason_has_words() -> None:
    known = {
        reason for name in ("frames_dropped", "bodies_rejected", "connections_refused") for reason in LABELS[name][1]
    }
    assert known - {"jump"} <= set(REASONS)


def test_what_others_have_named_is_text_on_the_stage() -> None:
    report = status(left_wrist=None)
    report["actors"]["actor"]["bodies"]["left_wrist"]["body"] = "<img src=x onerror=alert(1)>"
    report |= {
        "listening": {"bodies": "tcp://127.0.0.1:5556"},
        "doctor": [
            {"level": "problem", "text": "<b>x</b>", "remedy": "call it <i>y</i>"},
            {
                "level": "problem",
                "text": "left_wrist: no body arrives",
                "remedy": "name one of these in the rig: 'Left'",
            },
        ],
    }
    shown = html.card(verdict(report, 0.0), report)
    assert "tcp://127.0.0.1:5556" in shown
    assert "<img" not in shown
    assert "<b>x" not in shown
    assert "<i>y" not in shown
    assert shown.count("name one of these in the rig") == 1, "a hint stands beside its body, and only there"
    assert "<script" not in html.recording_mark({"name": "<script>.mcap", "seconds": 75.0})
    assert "REC 1:15" in html.recording_mark({"name": "a.mcap", "seconds": 75.0})
