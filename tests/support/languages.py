"""Builds the engine-free clients of all languages as commands that speak the text protocol of the harnesses."""

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from checkout import CLIENTS, ROOT, need

HARNESSES = ROOT / "tests" / "clients"
UNITY = CLIENTS / "unity" / "com.manipnet.client"
UNITY_HARNESSES = ("Glue.cs", "Features.cs", "AvatarScene.cs")
CSHARP = UNITY / "Runtime" / "Core"
CPP = CLIENTS / "unreal" / "ManipNetLiveLink" / "Source" / "ManipNetLiveLink" / "Private" / "Core"
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror")
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
NAMES = ("csharp", "gcc-sanitized", "gcc-threads", "clang", "javascript", "python")
"""C++ is built by gcc with its address and undefined-behaviour sanitizers, by gcc with its thread sanitizer, and with
optimisation by clang."""

SMALL_NURSERY = {"MONO_GC_PARAMS": "nursery-size=64k"}
"""Mono then collects after 64 kB, so no collection in n frames means less than 64 kB / n per frame."""


def build(name: str, folder: Path) -> list[str]:
    """Build a client's harness and return the command that runs it; skips the test where tools are missing."""
    builders = {
        "csharp": _csharp,
        "unity": _unity,
        "unreal-avatar": _unreal_avatar,
        "gcc-sanitized": lambda folder: _gcc(folder, *SANITIZERS),
        "gcc-threads": lambda folder: _gcc(folder, "-fsanitize=thread"),
        "clang": _clang,
        "javascript": _javascript,
        "python": lambda _: [sys.executable, str(HARNESSES / "python_harness.py")],
    }
    return builders[name](folder)


def _csharp(folder: Path) -> list[str]:
    mcs, mono = need("mcs", "mono")
    exe = folder / "harness.exe"
    sources = [*sorted(CSHARP.glob("*.cs")), HARNESSES / "csharp" / "Harness.cs"]
    options = ["-langversion:7.2", "-warn:4", "-warnaserror", "-optimize", "-r:System.Core", f"-out:{exe}"]
    subprocess.run([mcs, *options, *map(str, sources)], check=True)
    return [mono, str(exe)]


def _unity(folder: Path) -> list[str]:
    """The whole Unity package on stubs of the engine."""
    mcs, mono = need("mcs", "mono")
    exe, own = folder / "glue.exe", HARNESSES / "csharp"
    sources = [*sorted(UNITY.rglob("*.cs")), *(own / name for name in UNITY_HARNESSES), *sorted(own.glob("stubs/*.cs"))]
    # 649: Unity assigns fields by itself. 67 and 414: the stubs' attributes and events are not used.
    options = ["-langversion:7.2", "-warn:4", "-warnaserror", "-nowarn:649,67,414", "-r:System.Core", f"-out:{exe}"]
    subprocess.run([mcs, *options, *map(str, sources)], check=True)
    return [mono, str(exe)]


def _unreal_avatar(folder: Path) -> list[str]:
    """The whole Unreal plugin on stubs of the engine."""
    from unreal_headers import MODULE, write_headers  # it needs this module's paths

    exe, headers = folder / "avatar", folder / "engine"
    headers.mkdir()
    sources = [*MODULE.glob("Private/*.cpp"), *CPP.glob("*.cpp"), HARNESSES / "cpp" / "avatar.cpp"]
    options = [*write_headers(headers), "-pthread", *SANITIZERS, "-o", str(exe)]
    subprocess.run([*need("g++"), *options, *map(str, sources)], check=True)
    return [str(exe)]


def _gcc(folder: Path, *sanitizers: str) -> list[str]:
    return _cpp(need("g++")[0], folder / "gcc", "-g", *sanitizers)


def _clang(folder: Path) -> list[str]:
    return _cpp(need("clang++")[0], folder / "clang", "-O2")


def _cpp(compiler: str, exe: Path, *options: str) -> list[str]:
    sources = [*sorted(CPP.glob("*.cpp")), HARNESSES / "cpp" / "harness.cpp"]
    common = ["-std=c++17", *WARNINGS, "-pthread", f"-I{CPP}", *options, "-o", str(exe)]
    subprocess.run([compiler, *common, *map(str, sources)], check=True)
    return [str(exe)]


def _javascript(_: Path) -> list[str]:
    (node,) = need("node")
    # Node's own WebSocket must be enabled before version 22.
    options = ["--no-warnings", "--experimental-websocket", "--expose-gc", "--max-semi-space-size=64"]
    return [node, *options, str(HARNESSES / "web" / "harness.mjs")]


def run(command: list[str], *words: str, text: str = "") -> list[str]:
    """Run a harness to its end and return the lines that it prints."""
    done = subprocess.run([*command, *words], input=text, capture_output=True, encoding="utf-8", timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@dataclass
class LiveClient:
    """A running harness connected to a server; it answers each line with a line of figures."""

    process: subprocess.Popen

    @classmethod
    def start(cls, command: list[str], address: str, verb: str = "live") -> "LiveClient":
        """Start the harness with `live` or `idle`."""
        return cls.run([*command, verb, address])

    @classmethod
    def run(cls, words: list[str]) -> "LiveClient":
        """Start the harness with these words."""
        pipe, environment = subprocess.PIPE, {**os.environ, **SMALL_NURSERY}
        return cls(subprocess.Popen(words, stdin=pipe, stdout=pipe, encoding="utf-8", env=environment))

    def ask(self, what: str = "") -> Any:
        """The client's present figures, or with "arrivals" number and time of every frame since the last such call."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(f"{what}\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def ask_until(self, condition, limit_s: float = 30.0) -> dict:
        """Ask again and again until the figures meet a condition."""
        give_up = time.monotonic() + limit_s
        while not condition(figures := self.ask()):
            assert time.monotonic() < give_up, figures
        return figures

    def close(self) -> tuple[str, int]:
        """Close the harness's input; returns its last output and its exit status."""
        rest, _ = self.process.communicate(timeout=30)
        return rest.strip(), self.process.returncode

    def kill(self) -> None:
        """Kill the harness, whatever its state."""
        self.process.kill()
        self.process.communicate()
