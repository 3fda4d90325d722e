"""Packages of npm that tests check our files with; installed once per machine, where node is."""

import hashlib
import json
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import pytest

PATIENCE_S = 180


def run_node(script: str, *arguments: str, packages: tuple[str, ...]) -> Any:
    """What a CommonJS `script` prints as JSON; it may require the `packages` (`name@version`). Skips without node."""
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
    if not folder.is_dir():
        with tempfile.TemporaryDirectory(dir=folder.parent) as part:
            command = [npm, "install", "--silent", "--no-audit", "--no-fund", "--prefix", part, *packages]
            done = subprocess.run(command, cwd=part, capture_output=True, text=True, timeout=PATIENCE_S)
            if done.returncode:
                pytest.skip(f"npm cannot install {' '.join(packages)}: {done.stderr.strip()[-200:]}")
            shutil.copytree(part, folder, dirs_exist_ok=True)
    return folder
