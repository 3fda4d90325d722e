"""The benchmark runs on a small model, and its figures are consistent."""

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from manipnet.actors.spread import MANY
from manipnet.inputs.sender_stats import SenderStats
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.objects.repair import is_closed
from manipnet.wire.bodies import BodyFrame
from manipnet_tools import cli
from manipnet_tools.bench.harness import STAGES, TICK, TURN, TickRunner, race
from manipnet_tools.bench.intake import BONES, CHUNK, Case, cases, frame_of, time_cases
from manipnet_tools.bench.machine import this_machine
from manipnet_tools.bench.quick import Quick, verdict
from manipnet_tools.bench.report import lines, verdicts, with_ratios
from manipnet_tools.bench.scenarios import demo, endless
from manipnet_tools.bench.shapes import gourd


@pytest.mark.parametrize("triangles", [12, 100, 5000])
def test_a_gourd_is_closed_and_has_the_triangles(triangles: int) -> None:
    mesh = gourd(triangles)
    assert is_closed(mesh.faces)
    assert len(mesh.faces) == pytest.approx(triangles, rel=0.2)


def test_a_gourd_has_at_least_twelve_triangles() -> None:
    with pytest.raises(ValueError, match="at least 12 are needed"):
        gourd(11)


def test_a_scenario_never_jumps() -> None:
    scenario = demo()
    frames, count = endless(scenario, 2), 2 * len(scenario.frames) + 10
    poses = np.array([[body.p for body in next(frames).bodies] for _ in range(count)])
    assert poses.shape[1] == 2 * len(scenario.frames[0].bodies)
    assert np.abs(np.diff(poses, axis=0)).max() < 0.1


def test_the_stages_sum_to_the_whole_tick(tiny_bundle: Path) -> None:
    runners = {
        "one": TickRunner(load_bundle(tiny_bundle), demo()),
        "two": TickRunner(load_bundle(tiny_bundle), demo(), actors=2),
    }
    result = race(runners, lambda: None, 0.0, least_rounds=5)
    for name in runners:
        assert set(result.stages[name]) == set(STAGES)
        np.testing.assert_allclose(result.total(name), sum(result.stages[name][stage] for stage in TICK))
        assert all((of_stage > 0.0).all() for of_stage in result.stages[name].values())
    assert len(result.reference) == 5 * TURN
    scenes, states = runners["two"].synthesizer.inputs
    assert len(scenes) == len(states) == 4
    assert len(result.waits["two"]) == 5 * TURN
    assert (result.waits["two"] >= result.total("two")).all()


def test_a_tick_of_many_actors_is_that_of_all_their_batches(tiny_bundle: Path) -> None:
    runner = TickRunner(load_bundle(tiny_bundle), demo(120.0), MANY)
    spent_s = runner.tick()
    scenes, _ = runner.synthesizer.inputs
    assert len(scenes) == MANY  # two hands of half of the actors
    assert len(runner.waits_s) == 2
    assert max(runner.waits_s) < sum(spent_s.values()) <= sum(runner.waits_s) + 1e-9


def test_the_command_measures_and_writes_the_figures(
    tiny_bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sections = [word for name in ("tick", "live") for word in ("--only", name)]
    assert (
        cli.main(
            ["bench", "--seconds", "2", "--model", str(tiny_bundle), "--json", str(tmp_path / "b.json"), *sections]
        )
        == 0
    )
    figures = json.loads((tmp_path / "b.json").read_text(encoding="utf-8"))
    tick, live = figures["tick"], figures["live"]["0.5"]
    assert tick["total"]["p50_ms"] > tick["sense"]["p50_ms"] > 0.0
    assert tick["total"]["p50"] == pytest.approx(tick["total"]["p50_ms"] / tick["reference"]["p50_ms"])
    assert live["hands"] > 10
    assert 0.0 < live["latency"]["p50_ms"] < 1e3
    assert live["interval"]["p50_ms"] == pytest.approx(1e3 / 60.0, rel=0.5)
    printed = capsys.readouterr().out
    assert "published interval: p99" in printed
    assert figures["machine"]["processor"] in printed


def test_a_report_has_every_section_of_races() -> None:
    times = {"p50": 0.5, "p99": 0.75, "p50_ms": 1.5, "p99_ms": 2.5}
    raced = {stage: times for stage in (*STAGES, "total")}
    models = {"single": raced, "quantised": raced, "weights": "random", "quantised_apart_mm": 0.04}
    actors = {"1": raced | {"wait": times | {"p99_ms": 3.125}}}
    text = "\n".join(lines({"models": models, "actors": actors}, this_machine(), "tiny"))
    assert "quantised: random weights; random ones put joints at most 0.04 mm apart" in text
    assert text.count("due to out: p50") == 1
    assert "3.125" in text


def test_a_plain_installation_gets_a_verdict_in_a_sentence(
    tiny_bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for missing in ("onnx", "torch"):
        monkeypatch.setitem(sys.modules, missing, None)
    file = tmp_path / "quick.json"
    assert cli.main(["bench", "--model", str(tiny_bundle), "--seconds", "1", "--json", str(file)]) == 0
    *_, verdict, hint = capsys.readouterr().out.splitlines()
    assert verdict.startswith(("Yes, this computer", "Only just", "No, this computer"))
    assert "--full" in hint
    figures = json.loads(file.read_text(encoding="utf-8"))["quick"]
    assert figures["tick_p99_ms"] >= figures["tick_p50_ms"] > 0.0
    assert figures["verdict"] == verdict
    assert cli.main(["bench", "--model", str(tiny_bundle), "--full"]) == 1
    assert "onnx is not installed: python -m pip install 'manipnet-live[train]'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("tick_ms", "late_ms", "begin"), [(1.0, 0.3, "Yes"), (7.0, 4.0, "Only just"), (14.0, 5.0, "No")]
)
def test_the_verdict_follows_from_the_time_that_is_left(tick_ms: float, late_ms: float, begin: str) -> None:
    assert verdict(Quick(tick_ms, tick_ms, late_ms, 2.5 * tick_ms, 1.0)).startswith(begin)


@pytest.mark.parametrize("case", cases(), ids=lambda case: case.name)
def test_every_frame_of_the_intake_reaches_the_tick_thread(case: Case) -> None:
    received: list[BodyFrame] = []
    take = case.open(SenderStats(received.append))
    frames = [frame_of(n, case.bodies) for n in range(CHUNK)]
    for frame in frames:
        for datagram in case.write(frame):
            take(datagram, frame.t_s)
    assert len(received) == len(frames)
    for sent, got in zip(frames, received, strict=True):
        assert got.t_s == pytest.approx(sent.t_s, abs=1e-6)
        bodies = {body.id: body.tracked for body in got.bodies if body.id is not None}
        assert [bodies[body.id] for body in sent.bodies if body.id is not None] == [True] * case.bodies
        extra = BONES if case.name.startswith("NatNet and") else 0
        assert len(got.bodies) == case.bodies + extra


def test_the_intake_is_timed_beside_the_reference() -> None:
    found = time_cases(lambda: None, 0.0)
    assert set(found) == {"reference", *(case.name for case in cases())}
    assert all((durations > 0.0).all() for durations in found.values())


def test_only_measured_goals_get_a_verdict() -> None:
    actors = {name: {"total": {"p50_ms": ms}} for name, ms in (("1", 1.0), ("8", 4.0))}
    found = verdicts(with_ratios({"actors": actors, "straightforward": {"times": 25.0}}))
    assert [(goal.what, value, met) for goal, value, met in found] == [
        ("8 actors over 1", 4.0, False),
        ("straightforward version over ours", 25.0, True),
    ]
    assert all(math.isfinite(value) for _, value, _ in found)
