"""Finds a real Blender: the module `bpy` of PyPI, or the program."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from functools import cache

import pytest

OLDEST = (4, 2)


@cache
def blender_command() -> tuple[str, ...]:
    """The command that runs a Python script in Blender, to be followed by the script and its arguments.

    MANIPNET_BLENDER names a Python that has `bpy`, or Blender itself; otherwise this Python's `bpy` and then the
    program `blender` are tried. Skips the test if there is none, or only one that the extension does not support.
    """
    named = os.environ.get("MANIPNET_BLENDER")
    if named is None and importlib.util.find_spec("bpy") is not None:
        named = sys.executable
    named = named or shutil.which("blender")
    if named is None:
        pytest.skip("needs Blender: pip install bpy in any Python environment, and name its python in MANIPNET_BLENDER")
    is_program = "blender" in os.path.basename(named)
    command = (named, "-b", "--python-exit-code", "1", "--python") if is_program else (named,)
    version = _version(named, is_program)
    if version < OLDEST:
        pytest.skip(f"needs Blender {OLDEST[0]}.{OLDEST[1]}; {named} is {version[0]}.{version[1]}")
    return command


def run_in_blender(script: str, *arguments: str, environment: dict[str, str] | None = None) -> None:
    """Run a script in Blender; fails with its output if it fails."""
    command = blender_command()
    dashes = ("--",) if "-b" in command else ()
    done = subprocess.run(
        [*command, script, *dashes, *arguments],
        capture_output=True,
        text=True,
        timeout=240,
        env={**os.environ, **(environment or {}), "PYTHONPATH": ""},
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]


def _version(named: str, is_program: bool) -> tuple[int, int]:
    if is_program:
        text = subprocess.run([named, "--version"], capture_output=True, text=True, timeout=60).stdout
    else:
        script = "import bpy, os; print('Blender', bpy.app.version_string, flush=True); os._exit(0)"
        text = subprocess.run([named, "-c", script], capture_output=True, text=True, timeout=120).stdout
    found = re.search(r"Blender (\d+)\.(\d+)", text)
    if found is None:
        pytest.skip(f"{named} does not run Blender: {text.strip()[-200:]}")
    return int(found[1]), int(found[2])
