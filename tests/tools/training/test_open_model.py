"""The bundle manipnet-open may be used commercially: its card lists every input, and the tools read no other."""

import json
import os
import re
import subprocess
import sys
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path

import pytest

from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.model.shipped import find_bundle, shipped_hand
from manipnet_tools.generate.free_hand import FREE_HAND
from manipnet_tools.takes.sources import foreign_terms
from manipnet_tools.training.config import FOR_GENERATED

ROOT = Path(__file__).parents[3]
CARD = find_bundle("manipnet-open") / "CARD.md"
READS = """
import os, sys
root, out = os.path.realpath(sys.argv.pop(1)), os.path.realpath(sys.argv.pop(1))
found = set()
def watch(event, arguments):
    if event == "open" and isinstance(arguments[0], (str, bytes, os.PathLike)):
        found.add(os.path.realpath(os.fsdecode(arguments[0])))
sys.addaudithook(watch)
from manipnet_tools.cli import main
status = main(sys.argv[1:])
code = (".py", ".pyc", ".so", ".pyd", ".nbi", ".nbc")
inside = (name for name in found if name.startswith(root + os.sep) and not name.startswith(out))
data = (name for name in inside if os.path.isfile(name) and not name.endswith(code))
print("READ", *(os.path.relpath(name, root).replace(os.sep, "/") for name in data), sep="\\n")
sys.exit(status)
"""


def read_by(out: Path, *command: str) -> set[str]:
    """The files of the checkout, other than code, that a command of `manipnet` opens."""
    program = [sys.executable, "-c", READS, str(ROOT), str(out), *command]
    ended = subprocess.run(program, stdout=subprocess.PIPE, text=True, check=True, timeout=300, env=dict(os.environ))
    return set(ended.stdout.partition("READ\n")[2].split())


def listed(heading: str) -> dict[str, str]:
    """The rows of a table in the card, as far as they begin with two cells in code style."""
    section = CARD.read_text(encoding="utf-8").partition(f"## {heading}\n")[2].partition("\n## ")[0]
    return dict(re.findall(r"^\| `([^`]+)` \| `([^`]+)` \|", section, re.MULTILINE))


@pytest.mark.slow
def test_generating_and_training_read_what_the_card_lists(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="needs the extra generate")
    pytest.importorskip("manifold3d", reason="needs the extra generate")
    model = tmp_path / "model"
    arguments = ["--out", str(tmp_path / "set"), "--train", str(model), "--hours", "0.008", "--jobs", "1"]
    read = read_by(tmp_path, "generate", *arguments)
    assert load_bundle(str(model)).meta["licence"].startswith("Apache-2.0")
    inputs = listed("Inputs")
    assert read == inputs.keys()
    assert {name: sha256((ROOT / name).read_bytes()).hexdigest() for name in read} == inputs


def test_the_card_lists_the_files_of_the_hand_with_their_hashes() -> None:
    described = json.loads(FREE_HAND.with_suffix(".json").read_text(encoding="utf-8"))
    assert listed("Files of the hand") == described["files"]
    text = CARD.read_text(encoding="utf-8")
    assert described["package"] in text
    assert all(source in text for source in described["literature"])


def test_the_terms_allow_commercial_use() -> None:
    bundle = load_bundle("manipnet-open")
    assert foreign_terms(bundle.meta["licence"]) == []
    assert bundle.meta["licence"].startswith("Apache-2.0")
    assert all(take.startswith("generated-") for take in bundle.meta["training"]["takes"])
    assert not bundle.meta["training"]["started_from"]


def test_the_shipped_model_was_trained_by_the_recipe_of_the_command() -> None:
    training = load_bundle("manipnet-open").meta["training"]
    assert {name: training[name] for name in asdict(FOR_GENERATED) if name != "hidden"} == {
        name: value for name, value in asdict(FOR_GENERATED).items() if name != "hidden"
    }


def test_the_hand_is_not_that_of_the_captured_subject() -> None:
    assert shipped_hand("manipnet-open").name.startswith("free hand")
    assert not shipped_hand("manipnet-small").name.startswith("free hand")
