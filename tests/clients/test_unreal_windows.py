"""The Windows half of Unreal's core: built with mingw-w64 and run under Wine against a live stream."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from checkout import VECTORS, need, publishing
from languages import CPP, HARNESSES, WARNINGS, LiveClient, run

EXPECTED = json.loads((VECTORS / "expected.json").read_text(encoding="utf-8"))
WINE_FOLDERS = ("/usr/lib/wine", "/usr/lib/x86_64-linux-gnu/wine", "/opt/wine-stable/bin")


def wine(*names: str) -> str:
    """The path of a program of Wine, which Debian keeps out of the path. Skips the test if it is missing."""
    path = os.pathsep.join([os.environ["PATH"], *WINE_FOLDERS])
    found = next(filter(None, (shutil.which(name, path=path) for name in names)), None)
    if found is None:
        pytest.skip(f"needs {' or '.join(names)} (see clients/README.md for the Debian packages)")
    return found


@pytest.fixture(scope="module")
def windows(tmp_path_factory):
    """The command of the harness as a program for Windows."""
    (compiler,) = need("x86_64-w64-mingw32-g++-posix")
    loader, server = wine("wine64", "wine"), wine("wineserver64", "wineserver")
    folder: Path = tmp_path_factory.mktemp("windows")
    exe = folder / "harness.exe"
    sources = [*sorted(CPP.glob("*.cpp")), HARNESSES / "cpp" / "harness.cpp"]
    options = ["-std=c++17", *WARNINGS, "-O1", "-static", f"-I{CPP}", "-o", str(exe)]
    subprocess.run([compiler, *options, *map(str, sources), "-lws2_32"], check=True)
    environment = {"WINEPREFIX": str(folder / "prefix"), "WINEDEBUG": "-all", "DISPLAY": ""}
    command = ["env", *(f"{name}={value}" for name, value in environment.items()), loader, str(exe)]
    run(command, "connections", text="\n")  # makes Wine's folder
    yield command
    subprocess.run([server, "-k"], env={**os.environ, **environment}, check=False, timeout=60)


def test_reads_the_golden_vectors(windows):
    lines = run(windows, "decode", *(str(VECTORS / f"{name}.bin") for name in EXPECTED))
    for name, line in zip(EXPECTED, lines, strict=True):
        read = json.loads(line)
        assert (read["seq"], len(read["bodies"])) == (EXPECTED[name]["seq"], len(EXPECTED[name]["bodies"])), name


def test_receives_a_live_stream_over_windows_sockets(windows):
    with publishing() as (_, tcp, _):
        client = LiveClient.start(windows, tcp)
        try:
            figures = client.ask_until(lambda f: f["received"] > 60)
            assert (figures["state"], figures["refused"], figures["connections"]) == ("connected", 0, 1)
            assert client.close() == ("closed", 0)
        finally:
            client.kill()


def test_tries_every_address_of_a_name(windows):
    """`localhost` is ::1 first on Windows, where a server of 127.0.0.1 does not listen."""
    with publishing() as (_, tcp, _):
        client = LiveClient.start(windows, tcp.replace("127.0.0.1", "localhost"))
        try:
            assert client.ask_until(lambda f: f["received"] > 0)["state"] == "connected"
        finally:
            client.kill()


def test_says_that_nobody_answers(windows):
    client = LiveClient.start(windows, "tcp://127.0.0.1:1")
    try:
        figures = client.ask_until(lambda f: "reconnecting" in f["state"])
        assert "no server answers at 127.0.0.1:1" in figures["state"]
    finally:
        client.kill()
