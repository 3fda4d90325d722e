"""Cut files of the program's own, outputs that take no more, and a library that reports home: none stops a show."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from live_server import PATIENCE_S, START_S, free_ports, serving

OPTIONS = ("--mesh", "日本=hammer")
"""A prop that is not among those whose shapes come with the program."""


def start(folder: Path, tiny_bundle: Path, **environment: str) -> subprocess.Popen[bytes]:
    """A server on free ports whose output is read as bytes."""
    command = [sys.executable, "-m", "manipnet.cli", *free_ports(), "--model", str(tiny_bundle), *OPTIONS]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env={**os.environ, **environment}, cwd=folder
    )


def end(server: subprocess.Popen[bytes]) -> tuple[bytes, bytes]:
    """Stop it; what it wrote to both outputs."""
    server.terminate()
    written = server.communicate(timeout=PATIENCE_S)
    assert server.returncode == 0, written[1].decode(errors="replace")
    return written


def wait_ready(server: subprocess.Popen[bytes]) -> None:
    assert server.stdout is not None
    assert server.stdout.readline().startswith(b"ready ")


@pytest.fixture(scope="module")
def kernels(tiny_bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache that one start has filled."""
    folder = tmp_path_factory.mktemp("cache")
    for _ in range(2):
        server = start(folder, tiny_bundle, MANIPNET_CACHE=str(folder))
        wait_ready(server)
        _, errors = end(server)
    assert b"damaged" not in errors, "a start finds what the one before has left"
    return folder


def _empty(file: Path) -> None:
    file.write_bytes(b"")


def _keep_one_byte(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:1])


def _keep_half(file: Path) -> None:
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])


def _put_a_folder_in_its_place(file: Path) -> None:
    file.unlink()
    file.mkdir()


DAMAGES = (_empty, _keep_one_byte, _keep_half, _put_a_folder_in_its_place)


@pytest.mark.parametrize("suffix", [".nbi", ".nbc", ".npz"])
def test_a_cut_cache_is_rebuilt_and_reported(kernels: Path, tiny_bundle: Path, tmp_path: Path, suffix: str) -> None:
    cache = tmp_path / "cache"
    shutil.copytree(kernels, cache)
    files = sorted(cache.rglob(f"*{suffix}"))
    assert files, f"the cache holds no {suffix}"
    for file, damage in zip(files, DAMAGES, strict=False):  # a few, since all of it takes long to compile
        damage(file)
    server = start(tmp_path, tiny_bundle, MANIPNET_CACHE=str(cache))
    wait_ready(server)
    _, errors = end(server)
    assert b"Traceback" not in errors
    assert b"damaged" in errors


def test_a_name_that_the_output_cannot_show_ends_nothing(tiny_bundle: Path, tmp_path: Path) -> None:
    western = {"PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"}
    options = ("--model", str(tiny_bundle), "--takes", str(tmp_path), *OPTIONS)
    with serving(*options, environment=western) as server:
        assert server.ask({"op": "record", "name": "日本"})["name"] == "日本.mcap"
        assert server.stop() == 0
        assert "1 recording is kept" in list(iter(server.line, ""))[-1]
    assert (tmp_path / "日本.mcap").is_file()


def test_a_name_that_the_system_cannot_write_is_refused_by_its_reason(tiny_bundle: Path, tmp_path: Path) -> None:
    ascii_only = {"LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    takes = tmp_path / "takes"
    with serving("--model", str(tiny_bundle), "--takes", str(takes), environment=ascii_only) as server:
        for request in ({"op": "record", "name": "Übung"}, {"op": "add_object", "file": str(tmp_path / "Würfel.ply")}):
            error = server.ask(request)["error"]
            assert "this system cannot write" in error
            assert "PYTHONUTF8=1" in error
        assert server.ask({"op": "record", "name": "Uebung"})["name"] == "Uebung.mcap"
        assert "error" not in server.ask({"op": "stop_recording"})


def test_takes_are_listed_although_one_is_a_link_to_nowhere(tiny_bundle: Path, tmp_path: Path) -> None:
    (tmp_path / "lost.mcap").symlink_to(tmp_path / "nowhere.mcap")
    (tmp_path / "whole.mcap").touch()
    with serving("--model", str(tiny_bundle), "--takes", str(tmp_path)) as server:
        assert server.ask({"op": "recordings"})["recordings"] == ["whole.mcap", "lost.mcap"]


def test_a_closed_pipe_leaves_the_log_alive(tiny_bundle: Path, tmp_path: Path) -> None:
    server = start(tmp_path, tiny_bundle)
    wait_ready(server)
    assert server.stdout is not None
    assert server.stderr is not None
    server.stdout.close()
    # Nobody sends bodies: the server says so on standard error a few seconds later, if it still says anything.
    assert server.stderr.readline()
    server.terminate()
    server.stdout = None
    server.communicate(timeout=PATIENCE_S)
    assert server.returncode == 0


def test_doctor_writes_its_report_in_a_narrow_encoding(tmp_path: Path) -> None:
    report = tmp_path / "report.txt"
    environment = {**os.environ, "PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"}
    command = [sys.executable, "-m", "manipnet_tools.cli", "doctor", "--seconds", "0.5", "--server", "127.0.0.1:1"]
    with report.open("wb") as file:
        done = subprocess.run(command, stdout=file, stderr=subprocess.PIPE, env=environment, timeout=START_S)
    assert b"Error" not in done.stderr, done.stderr.decode(errors="replace")
    assert report.stat().st_size > 0


def test_no_library_reports_home(tiny_bundle: Path, tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    cache = os.environ.get("MANIPNET_CACHE") or str(Path.home() / ".cache" / "manipnet")
    server = start(tmp_path, tiny_bundle, HOME=str(home), MANIPNET_CACHE=cache, XDG_CACHE_HOME=str(home / "cache"))
    wait_ready(server)
    end(server)
    left = [str(path) for path in home.rglob("*") if "Microsoft" in str(path) or "onnxruntime" in path.name.lower()]
    assert left == []


def test_the_doctors_report_goes_into_a_file_of_any_encoding(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "manipnet_tools.cli", "doctor", "--seconds", "0.5"]
    ports = ["--input-port", "0", "--osc-port", "0", "--server", "127.0.0.1:1"]
    narrow = {**os.environ, "PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"}
    with open(tmp_path / "report.txt", "wb") as report:
        ended = subprocess.run(
            [*command, *ports], stdout=report, stderr=subprocess.PIPE, env=narrow, timeout=START_S, check=False
        )
    assert b"Traceback" not in ended.stderr
    assert "nothing arrives" in (tmp_path / "report.txt").read_text(encoding="cp1252")
