"""`manipnet batch`: every good take gets one result, on this machine or on a cluster."""

import io
import json
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from live_server import PATIENCE_S
from rich.console import Console
from tracked_bodies import record_scene

from manipnet.synthesis.objects.library import LIBRARY_FOLDER
from manipnet_tools import cli
from manipnet_tools.batch.command import find_takes, table, take_names
from manipnet_tools.batch.job import Job, Outcome
from manipnet_tools.batch.local import run_locally

CUBE = LIBRARY_FOLDER / "cube.ply"


def record(path: Path, seconds: float = 1.3, prop: str = "Box") -> Path:
    return record_scene(path, seconds, names={"Box": prop})


@pytest.fixture
def takes(tmp_path: Path) -> Path:
    """Two good takes, three bad ones, and a text that is not a take."""
    folder = tmp_path / "takes"
    for name in ("a", "day2/b"):
        record(folder / f"{name}.mcap")
    record(folder / "short.mcap", 0.5)
    record(folder / "other.mcap", prop="Hat")
    (folder / "broken.csv").write_text("nothing\n")
    (folder / "readme.txt").write_text("Read me.\n")
    return folder


def batch(takes: Path, out: Path, model: Path, *more: str) -> int:
    options = ["--mesh", f"Box={CUBE}", "--model", str(model), "--out", str(out), *more]
    return cli.main(["batch", str(takes), *options])


def summary(out: Path) -> dict[str, dict]:
    return {take["name"]: take for take in json.loads((out / "summary.json").read_text())["takes"]}


def check_results(out: Path) -> None:
    takes = summary(out)
    states = {name: take["state"] for name, take in takes.items()}
    assert states == {"a": "done", "day2_b": "done", "short": "failed", "other": "failed", "broken": "failed"}
    assert "must be longer than 1 s" in takes["short"]["reason"]
    assert takes["other"]["reason"] == "no --mesh: at least one of the take's objects needs a mesh (Hat)"
    assert takes["broken"]["reason"].startswith("is not a CSV export of Motive")
    assert sorted(path.name for path in out.glob("*.npz")) == ["a.npz", "day2_b.npz"]
    assert not list(out.glob("*.part"))
    with np.load(out / "a.npz") as file:
        assert len(file["time"]) == takes["a"]["frames"] > 10
        assert file["left_positions"].shape[1:] == (22, 3)


def test_a_failed_take_does_not_stop_the_others(
    takes: Path, tmp_path: Path, tiny_bundle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert batch(takes, out, tiny_bundle, "--jobs", "2") == 1
    check_results(out)
    printed = capsys.readouterr().err
    assert "3 of 5 takes failed" in printed
    assert "speed" in printed

    stamps = {path.name: path.stat().st_mtime_ns for path in out.glob("*.npz")}

    for name in ("short.mcap", "other.mcap", "broken.csv"):
        (takes / name).unlink()
    record(takes / "c.mcap")
    assert batch(takes, out, tiny_bundle, "--jobs", "1") == 0
    states = {name: take["state"] for name, take in summary(out).items()}
    assert states == {"a": "skipped", "c": "done", "day2_b": "skipped"}
    assert stamps == {name: (out / name).stat().st_mtime_ns for name in stamps}
    assert summary(out)["a"]["frames"] > 10

    record(takes / "new.mcap", 1.6).replace(takes / "a.mcap")
    (out / "c.json").write_text('{"cut')
    assert batch(takes, out, tiny_bundle, "--jobs", "1") == 0
    states = {name: take["state"] for name, take in summary(out).items()}
    assert states == {"a": "done", "c": "done", "day2_b": "skipped"}


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_when_a_process_dies_only_its_take_fails(takes: Path, tmp_path: Path, tiny_bundle: Path) -> None:
    jobs = [
        Job(name, takes / file, {"Box": CUBE}, tiny_bundle, 0.5, None, tmp_path / f"{name}.npz")
        for name, file in (("first", "a.mcap"), ("second", "day2/b.mcap"))
    ]
    killed: list[str] = []

    def kill_once(name: str, done: int, total: int) -> None:
        if not killed:
            killed.append(name)
            (process,) = multiprocessing.active_children()
            assert process.pid is not None
            os.kill(process.pid, signal.SIGKILL)

    outcomes = list(run_locally(jobs, 1, kill_once))
    by_name = {outcome.name: outcome for outcome in outcomes}
    assert by_name["second"].state == "done"
    assert by_name["first"].state in ("failed", "done")
    assert not multiprocessing.active_children()


def test_takes_are_found_at_any_depth_and_get_different_names(tmp_path: Path) -> None:
    for name in ("one/leftHand.bvh", "one/rightHand.bvh", "walk.csv", "walk.mcap", "day/walk.csv", "notes.txt", "a.md"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("x")
    (tmp_path / "demo.txt").write_text("120\n1,2\n")
    found = find_takes(tmp_path)
    assert [str(path.relative_to(tmp_path)) for path in found] == [
        "day/walk.csv",
        "demo.txt",
        "one",
        "walk.csv",
        "walk.mcap",
    ]
    assert take_names(tmp_path, found) == ["day_walk", "demo", "one", "walk.csv", "walk.mcap"]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"--jobs": "0"}, "--jobs is 0; it must be at least 1"),
        ({"--look-ahead": "2"}, "--look-ahead is 2 s; allowed are 0 to 0.5"),
        ({"--mesh": "cube"}, "--mesh cube: must be NAME=FILE"),
        ({"--mesh": "Box=gone.obj"}, "gone.obj"),
        ({"--model": "gone"}, "model 'gone' is neither a folder nor a shipped bundle"),
    ],
)
def test_options_that_no_take_could_use_are_refused_before_any_work(
    takes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], change: dict[str, str], complaint: str
) -> None:
    options = {"--out": str(tmp_path / "out")} | change
    assert cli.main(["batch", str(takes), *(word for pair in options.items() for word in pair)]) == 1
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_without_takes_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["batch", str(tmp_path), "--out", str(tmp_path / "out")]) == 1
    assert "no take found; a take is a folder of BVH files" in capsys.readouterr().err
    assert cli.main(["batch", str(tmp_path / "x.csv"), "--out", str(tmp_path / "out")]) == 1
    assert "is not a folder" in capsys.readouterr().err


@pytest.fixture
def two_workers(tmp_path: Path) -> Iterator[str]:
    """The address of a Ray cluster on this machine that another process started, with two workers."""
    pytest.importorskip("ray", reason="Ray is not installed: python -m pip install 'manipnet-live[cluster]'")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    options = f"--head --block --num-cpus=2 --port={port} --node-ip-address=127.0.0.1 --include-dashboard=false"
    options += f" --object-store-memory=100000000 --temp-dir={tempfile.mkdtemp(prefix='ray', dir='/tmp')}"
    command = [Path(sys.executable).with_name("ray"), "start", *options.split()]
    environment = {**os.environ, "RAY_USAGE_STATS_ENABLED": "0"}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment
    ) as head:
        assert head.stdout is not None
        lines = []
        while not any("Ray runtime started" in line for line in lines):
            line = head.stdout.readline()
            assert line, lines
            lines.append(line)
        yield f"127.0.0.1:{port}"
        assert head.poll() is None, "the batch shut down a cluster that it had not started"
        head.terminate()
        head.stdout.read()
        head.wait(PATIENCE_S)


@pytest.mark.skipif(sys.platform == "win32", reason="Ray's command does not run on Windows")
def test_a_cluster_gives_the_same_results(
    takes: Path, tmp_path: Path, tiny_bundle: Path, two_workers: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out, here = tmp_path / "out", tmp_path / "here"
    assert batch(takes, out, tiny_bundle, "--ray", two_workers) == 1
    check_results(out)
    assert batch(takes, here, tiny_bundle, "--jobs", "1") == 1
    with np.load(out / "a.npz") as ours, np.load(here / "a.npz") as theirs:
        assert all(np.array_equal(ours[key], theirs[key]) for key in theirs.files)
    assert batch(takes, here, tiny_bundle, "--ray", two_workers) == 1
    states = {take["state"] for name, take in summary(here).items() if name in ("a", "day2_b")}
    assert states == {"skipped"}, "results that were made without a cluster are up to date for one"


def test_without_ray_the_error_says_how_to_install_it(
    takes: Path, tmp_path: Path, tiny_bundle: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.delitem(sys.modules, "manipnet_tools.batch.cluster", raising=False)
    assert batch(takes, tmp_path / "out", tiny_bundle, "--ray", "auto") == 1
    assert "pip install 'manipnet-live[cluster]'" in capsys.readouterr().err


def test_the_table_shows_a_whole_reason_beside_its_take_in_80_columns() -> None:
    reason = "is not a CSV export of Motive, whose first line starts with Format Version; turn on Header Information"
    outcomes = [Outcome("day 1_broken", "failed", reason=reason), Outcome("day 1_good", "done", 600, 2.0)]
    console = Console(file=io.StringIO(), width=80)
    console.print(table(outcomes))
    assert isinstance(console.file, io.StringIO)
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    cells = [line.split("│")[3].strip() for line in lines if line.startswith("│") and "day 1_good" not in line]
    assert " ".join(filter(None, cells)) == reason
    titles = next(line for line in lines if "take" in line)
    assert titles.index("reason") < titles.index("length")
