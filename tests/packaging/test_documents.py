"""Documents lead somewhere: every relative link of every Markdown file names a file, and an anchor that is there."""

import ast
import re
import subprocess
from pathlib import Path

import pytest

from manipnet.inputs import INPUTS
from manipnet.telemetry import BODY_REASONS, DROP_REASONS

ROOT = Path(__file__).parents[2]
LINK = re.compile(r"\]\(([^)\s]+)\)")
LISTED = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=False)
PATHS = LISTED.stdout.split()
README_LINES = 100


def anchors(path: Path) -> set[str]:
    """The anchors of a file's headings, as GitHub and MkDocs make them."""
    headings = re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("path", PATHS)
def test_every_link_leads_somewhere(path: str) -> None:
    text = re.sub(r"^```.*?^```", "", (ROOT / path).read_text(encoding="utf-8"), flags=re.M | re.S)
    for link in LINK.findall(text):
        target, _, anchor = link.partition("#")
        if ":" in target:
            continue
        file = (ROOT / path).parent / target if target else ROOT / path
        assert file.exists(), f"{path} links to {link}"
        if anchor and file.suffix == ".md":
            assert anchor in anchors(file), f"{path} links to {link}"


def test_the_readme_stays_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) < README_LINES


def texts() -> str:
    """Every piece of text in the programs, one to a line."""
    paths = [path for folder in ("server", "tools") for path in (ROOT / folder).rglob("*.py")]
    nodes = (node for path in paths for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    return "\n".join(node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str))


def test_troubleshooting_quotes_what_the_programs_say() -> None:
    page, said = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8"), texts()
    cells = re.findall(r"^\| ([^|]*`[^|]*) \|", page, re.M)
    quoted = [piece.strip() for cell in cells for code in re.findall(r"`([^`]*)`", cell) for piece in code.split("…")]
    assert [piece for piece in quoted if piece not in said] == []


def test_the_errand_about_dropped_bodies_names_every_reason() -> None:
    errand = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split("### Find out why a body is dropped")[1]
    rows = [row.split("|") for row in re.findall(r"^\| `.*", errand, re.M)]
    listed = {reason for row in rows for reason in re.findall(r"`(\w+)`", row[1])}
    declared = {reason for each in INPUTS for reason in each.drop_reasons} | {*DROP_REASONS, *BODY_REASONS}
    assert listed == declared
    for file in re.findall(r"`(\w+/\w+\.py)`", errand):
        assert (ROOT / "server" / "manipnet" / file).is_file(), file


@pytest.mark.parametrize(
    "path", ["CONTRIBUTING.md", "README.md", "RELEASING.md", "docs/architecture.md", "clients/README.md"]
)
def test_files_that_documents_name_are_there(path: str) -> None:
    named = re.findall(
        r"`((?:server|tools|tests|clients|docs|examples|benchmarks|models)/[\w./-]+)`",
        (ROOT / path).read_text(encoding="utf-8"),
    )
    assert [name for name in named if not (ROOT / name).exists() and "NAME" not in name] == []


def test_the_architecture_names_modules_that_are_there() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = re.findall(r"`((?!server/|tools/|tests/)[a-z_]+/[a-z_/]+)(?:\.py)?`", page)
    folder = ROOT / "server" / "manipnet"
    assert len(named) > 20
    assert [name for name in named if not (folder / name).is_dir() and not (folder / f"{name}.py").is_file()] == []
