"""`manipnet completion`: what the scripts of the shells offer."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from manipnet_tools.commands.completion import candidates
from manipnet_tools.commands.verbs import VERBS


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("rec", ["record", "recover"]),
        ("record --s", ["--server", "--seconds"]),
        ("record --out ", []),
        ("export take.mcap --format ", ["bvh", "gltf", "csv"]),
        ("serve --solver w", ["wrench"]),
        ("rig ", ["init", "show"]),
        ("rig init --left", ["--left-wrist"]),
        ("rig show --look", ["--look-ahead"]),
        ("hand import a --na", ["--name"]),
        ("conjure --", []),
    ],
)
def test_words_are_completed(line: str, offered: list[str]) -> None:
    assert candidates(line.split(" ")) == offered


def test_every_verb_has_options_to_complete() -> None:
    for verb in VERBS:
        assert "--help" in candidates([verb, "--h"]), verb


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
def test_bash_completes_with_the_script(tmp_path: Path) -> None:
    program = tmp_path / "manipnet"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m manipnet_tools.cli "$@"\n')
    program.chmod(0o755)
    script = f"""
    PATH="{tmp_path}:$PATH"
    eval "$(manipnet completion bash)"
    COMP_WORDS=(manipnet record --ser) COMP_CWORD=2
    _manipnet
    echo "${{COMPREPLY[@]}}"
    """
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "--server\n"
