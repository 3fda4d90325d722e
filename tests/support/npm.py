"""Runs scripts that check our files with packages of npm, which are installed once per machine."""

import hashlib
import json
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import pytest
from filelock import FileLock

PATIENCE_S = 180


def run_node(script: str, *arguments: str, packages: tuple[str, ...]) -> Any:
    """Run a CommonJS `script` that may require the `packages` (`name@version`), and return the JSON that it prints.

    Skips the test if node or the packages cannot be had.
    """
    node, npm = shutil.which("node"), shutil.which("npm")
    if node is None or npm is None:
        pytest.skip("node and npm are not installed (https://nodejs.org)")
    folder = _installed(npm, packages)
    command = [node, "-e", script, *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def _installed(npm: str, packages: tuple[str, ...]) -> Path:
    key = hashlib.sha256(" ".join(packages).encode()).hexdigest()[:12]
    folder = Path(tempfile.gettempdir()) / f"manipnet-npm-{key}"
    with FileLock(f"{folder}.lock"):
        if not folder.is_dir():
            with tempfile.TemporaryDirectory(dir=folder.parent) as part:
                command = [npm, "install", "--silent", "--no-audit", "--no-fund", "--prefix", part, *packages]
                done = subprocess.run(command, cwd=part, capture_output=True, text=True, timeout=PATIENCE_S)
                if done.returncode:
                    pytest.skip(f"npm cannot install {' '.join(packages)}: {done.stderr.strip()[-200:]}")
                shutil.copytree(part, f"{folder}.part", symlinks=True, dirs_exist_ok=True)
            Path(f"{folder}.part").rename(folder)
    return folder
