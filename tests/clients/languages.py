"""The engine-free clients of other languages, each as a command that speaks the harness's text protocol."""

import json
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

from support import CLIENTS, ROOT, need

HARNESSES = ROOT / "tests" / "clients"
CSHARP = CLIENTS / "unity" / "com.manipnet.client" / "Runtime" / "Core"
CPP = CLIENTS / "unreal" / "ManipNetLiveLink" / "Source" / "ManipNetLiveLink" / "Private" / "Core"
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror")
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
NAMES = ("csharp", "gcc-sanitized", "clang", "javascript")


def build(name: str, folder: Path) -> list[str]:
    """The command that runs a client's harness; skips the test where its tools are missing."""
    return {"csharp": _csharp, "gcc-sanitized": _gcc, "clang": _clang, "javascript": _javascript}[name](folder)


def _csharp(folder: Path) -> list[str]:
    mcs, mono = need("mcs", "mono")
    exe = folder / "harness.exe"
    sources = [*sorted(CSHARP.glob("*.cs")), HARNESSES / "csharp" / "Harness.cs"]
    options = ["-langversion:7.2", "-warn:4", "-warnaserror", "-optimize", "-r:System.Core", f"-out:{exe}"]
    subprocess.run([mcs, *options, *map(str, sources)], check=True)
    return [mono, str(exe)]


def _gcc(folder: Path) -> list[str]:
    return _cpp(need("g++")[0], folder / "gcc", "-g", *SANITIZERS)


def _clang(folder: Path) -> list[str]:
    return _cpp(need("clang++")[0], folder / "clang", "-O2")


def _cpp(compiler: str, exe: Path, *options: str) -> list[str]:
    sources = [*sorted(CPP.glob("*.cpp")), HARNESSES / "cpp" / "harness.cpp"]
    common = ["-std=c++17", *WARNINGS, "-pthread", f"-I{CPP}", *options, "-o", str(exe)]
    subprocess.run([compiler, *common, *map(str, sources)], check=True)
    return [str(exe)]


def _javascript(_: Path) -> list[str]:
    (node,) = need("node")
    # Before version 22 node's own WebSocket has to be asked for.
    return [node, "--no-warnings", "--experimental-websocket", str(HARNESSES / "web" / "harness.mjs")]


def run(command: list[str], *words: str, text: str = "") -> list[str]:
    """Lines a harness prints."""
    done = subprocess.run([*command, *words], input=text, capture_output=True, encoding="utf-8", timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@dataclass
class LiveClient:
    """A harness connected to a server: every question gets a line of figures."""

    process: subprocess.Popen

    @classmethod
    def start(cls, command: list[str], address: str) -> "LiveClient":
        """Run the harness's `live`."""
        pipe = subprocess.PIPE
        return cls(subprocess.Popen([*command, "live", address], stdin=pipe, stdout=pipe, encoding="utf-8"))

    def ask(self) -> dict:
        """The client's figures as of now."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def ask_until(self, condition, limit_s: float = 30.0) -> dict:
        """Ask until the figures meet a condition."""
        give_up = time.monotonic() + limit_s
        while not condition(figures := self.ask()):
            assert time.monotonic() < give_up, figures
        return figures

    def close(self) -> tuple[str, int]:
        """End it by the end of its input; its last words and its exit status."""
        rest, _ = self.process.communicate(timeout=30)
        return rest.strip(), self.process.returncode

    def kill(self) -> None:
        """Whatever state it is in."""
        self.process.kill()
        self.process.communicate()
