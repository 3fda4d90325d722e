"""Counters with closed labels, timings, gauges, the log that cannot be flooded, and the mailbox."""

import ast
import json
import logging
import re
import sys
import threading
from pathlib import Path

import pytest

from manipnet.common.log_limits import RepeatFilter
from manipnet.inputs import INPUTS
from manipnet.runtime.console import Console
from manipnet.runtime.mailbox import MAX_FRAMES, MAX_REQUESTS, BusyError, Mailbox
from manipnet.runtime.status import SilenceWatch
from manipnet.telemetry import DROP_REASONS, LABELS, Recent, Telemetry, Timings
from manipnet.tracking.tick import BodyHealth
from manipnet.wire.bodies import BodyFrame

SOURCES = sorted((Path(__file__).parents[1] / "server").rglob("*.py"))


def test_counters_count_by_label_from_any_thread() -> None:
    telemetry = Telemetry()
    telemetry.declare("frames_in", "osc")
    threads = [
        threading.Thread(target=lambda: [telemetry.count("frames_in", source="osc") for _ in range(1000)])
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert telemetry.counts() == {"frames_in": {"osc": 4000}}


@pytest.mark.parametrize(
    ("name", "label"),
    [("frames", {"source": "osc"}), ("frames_in", {"source": "pigeon"}), ("frames_in", {"by": "osc"})],
)
def test_a_counter_or_label_that_is_not_declared_is_an_error(name: str, label: dict[str, str]) -> None:
    telemetry = Telemetry()
    telemetry.declare("frames_in", "osc")
    with pytest.raises(KeyError):
        telemetry.count(name, 1, **label)


def test_what_is_declared_twice_is_one_label() -> None:
    telemetry = Telemetry()
    telemetry.declare("frames_dropped", "malformed", "late")
    telemetry.declare("frames_dropped", "malformed")
    assert telemetry.labels()["frames_dropped"] == ("reason", (*DROP_REASONS, "malformed"))
    assert Telemetry().labels()["frames_dropped"] == ("reason", DROP_REASONS)


def test_every_count_in_the_source_is_declared() -> None:
    """A label that is misspelt in a rare branch would raise there, so all literals are checked here."""
    found = 0
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "count"):
                continue
            if not (node.keywords and isinstance(node.args[0], ast.Constant) and isinstance(node.args[0].value, str)):
                continue  # counts characters of a text
            label, values = LABELS[node.args[0].value]
            (keyword,) = node.keywords
            assert keyword.arg == label, f"{path.name}:{node.lineno}"
            if isinstance(keyword.value, ast.Constant):
                assert keyword.value.value in values, f"{path.name}:{node.lineno}"
            found += 1
    assert found > 10


def test_every_reason_for_which_a_receiver_drops_is_declared() -> None:
    for declared in INPUTS:
        module = sys.modules[declared.open.__module__]
        source = Path(str(module.__file__))
        files = source.parent.rglob("*.py") if source.name == "__init__.py" else [source]
        text = "".join(path.read_text(encoding="utf-8") for path in files)
        assert set(re.findall(r'drop\(\s*"(\w+)"', text)) | {"malformed"} <= {*declared.drop_reasons}
        assert all(f'"{reason}"' in text for reason in declared.drop_reasons)


def test_timings_keep_all_and_the_newest() -> None:
    timings = Timings(window=100)
    for milliseconds in range(1, 1001):
        timings.record("total", milliseconds * 1e-3)
    assert timings.overall("total", 50.0, 100.0) == pytest.approx([0.5, 1.0], rel=2e-3)
    assert timings.recent("total", 0.0, 100.0) == pytest.approx([0.901, 1.0])
    assert timings.recent("total", 50.0) == [0.0], "read once"
    assert timings.totals("total") == (1000, pytest.approx(500.5))


def test_what_has_not_happened_for_long_does_not_happen_at_any_rate() -> None:
    recent = Recent()
    recent.note(96, 100.0)
    assert recent.report(101.0)["rate_hz"] > 0.0
    assert recent.report(110.0) == {"rate_hz": 0.0, "age_s": 10.0}


def test_gauges_are_measured_when_they_are_read() -> None:
    telemetry, level = Telemetry(), {"hands": 1.0}
    telemetry.add_gauges(lambda: [("connections", "socket", dict(level))])
    telemetry.add_gauges(lambda: iter(()))
    level["hands"] = 2.0
    assert list(telemetry.gauges()) == [("connections", "socket", {"hands": 2.0})]


def record(text: str, level: int = logging.WARNING) -> logging.LogRecord:
    return logging.LogRecord("manipnet", level, __file__, 1, text, (), None)


def test_repeated_lines_are_held_back_and_counted() -> None:
    now = [0.0]
    limit = RepeatFilter(lambda: now[0], interval_s=5.0)
    shown = []
    for second in range(12):
        now[0] = float(second)
        line = record("lost a frame")
        if limit.filter(line):
            shown.append(line.getMessage())
    assert shown == ["lost a frame", "lost a frame (and 4 more like it)", "lost a frame (and 4 more like it)"]
    assert limit.filter(record("another"))
    assert all(limit.filter(record("news", logging.INFO)) for _ in range(3))


def test_a_log_line_as_json_has_its_parts(capsys: pytest.CaptureFixture[str]) -> None:
    terminal = Console(as_json=True)
    for dropped in (3, 4):
        terminal.handle(logging.LogRecord("manipnet.x", logging.WARNING, __file__, 1, "lost %d\n", (dropped,), None))
    try:
        raise ValueError("ouch")
    except ValueError:
        failed = logging.LogRecord("manipnet.x", logging.ERROR, __file__, 1, "failed", (), sys.exc_info())
    terminal.handle(failed)
    terminal.close()
    lost, broken = map(json.loads, capsys.readouterr().err.splitlines())
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", lost.pop("time"))
    assert lost == {"level": "warning", "logger": "manipnet.x", "event": "lost %d\n", "message": "lost 3\n"}
    assert broken["exception"].endswith("ValueError: ouch")


def a_frame(t_s: float) -> BodyFrame:
    return BodyFrame(t_s, None, (), t_s, "zmq")


def test_the_mailbox_keeps_the_newest_frames_and_counts_the_others() -> None:
    telemetry = Telemetry()
    mailbox = Mailbox(telemetry)
    for i in range(MAX_FRAMES + 7):
        mailbox.put(a_frame(float(i)))
    frames = mailbox.wait(0.0)
    assert [frame.t_s for frame in frames] == [float(i) for i in range(7, MAX_FRAMES + 7)]
    assert telemetry.counts() == {"frames_dropped": {"mailbox_full": 7}}
    assert mailbox.wait(0.0) == []


def test_frames_before_the_awaited_one_do_not_end_the_wait() -> None:
    mailbox = Mailbox(Telemetry())

    class Awaited(dict[str, float]):
        def __bool__(self) -> bool:
            sending.start()  # it waits for the lock until `wait` waits
            return True

    for source, sent in (("zmq", [1.0, 2.0, 5.0]), ("another", [1.0])):
        frames = [a_frame(t_s)._replace(source=source) for t_s in sent]
        sending = threading.Thread(target=lambda frames=frames: [mailbox.put(frame) for frame in frames])
        assert mailbox.wait(60.0, Awaited(zmq=5.0)) == frames
        sending.join()


def test_a_question_is_answered_on_the_tick_thread() -> None:
    mailbox, answers = Mailbox(Telemetry()), []
    asking = threading.Thread(target=lambda: answers.append(mailbox.ask(threading.get_ident, timeout_s=20.0)))
    asking.start()
    while not answers:
        mailbox.wait(0.1)
        if not asking.is_alive():
            break
    asking.join()
    assert answers == [threading.get_ident()]


def test_an_error_in_a_question_goes_to_the_thread_that_asked() -> None:
    mailbox, errors = Mailbox(Telemetry()), []

    def ask() -> None:
        with pytest.raises(ZeroDivisionError):
            mailbox.ask(lambda: 1 / 0, timeout_s=20.0)
        errors.append(True)

    asking = threading.Thread(target=ask)
    asking.start()
    while asking.is_alive():
        mailbox.wait(0.01)
    assert errors == [True]


def test_unanswered_questions_time_out_and_are_bounded() -> None:
    mailbox = Mailbox(Telemetry())
    for _ in range(MAX_REQUESTS):
        with pytest.raises(BusyError, match="did not answer"):
            mailbox.ask(lambda: None, timeout_s=0.0)
    with pytest.raises(BusyError, match="too many requests"):
        mailbox.ask(lambda: None, timeout_s=0.0)
    assert mailbox.wait(0.0) == []
    with pytest.raises(BusyError, match="did not answer"):
        mailbox.ask(lambda: None, timeout_s=0.0)


class FakeActor:
    """The part of an actor that the watch reads: its name and the age of one body."""

    def __init__(self) -> None:
        self.config = type("Config", (), {"name": "ann"})
        self.age_s = 0.0

    def health(self, now_s: float) -> dict[str, BodyHealth]:
        return {"left_wrist": BodyHealth(120.0, self.age_s)}


def test_a_lost_body_is_reported_after_3_and_10_seconds_and_when_it_is_back(
    caplog: pytest.LogCaptureFixture,
) -> None:
    watch, actor = SilenceWatch(), FakeActor()
    for age_s in (float("inf"), 0.1, 1.0, 2.0, 3.5, 4.0, 9.0, 10.5, 11.0, 0.1, 0.2):
        actor.age_s = age_s
        watch.look([actor], 0.0)  # type: ignore[list-item]
    assert [(r.levelname, r.getMessage()) for r in caplog.records] == [
        ("WARNING", "ann: left_wrist has not been tracked for 4 s"),
        ("ERROR", "ann: left_wrist has not been tracked for 10 s"),
        ("WARNING", "ann: left_wrist is tracked again"),
    ]
