"""Carry out the COPY steps of the Dockerfile in an empty folder: `python .ci/container.py FOLDER`.

No container engine is needed. What `.dockerignore` names is not copied, so a wheel that is built in the folder shows
that the image gets everything that it installs.
"""

import fnmatch
import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def instructions() -> Iterator[tuple[str, str]]:
    """The instructions of the Dockerfile, each with its arguments as one text."""
    text = (ROOT / "Dockerfile").read_text(encoding="utf-8").replace("\\\n", " ")
    for line in text.splitlines():
        if line.strip() and not line.startswith("#"):
            word, _, rest = line.partition(" ")
            yield word, rest.strip()


def command() -> list[str]:
    """What a container runs: the ENTRYPOINT and the CMD."""
    return [word for wanted in ("ENTRYPOINT", "CMD") for word in json.loads(dict(instructions())[wanted])]


def copy(folder: Path) -> None:
    """Copy into `folder` what the image gets. Raises `FileNotFoundError` for what does not exist or is ignored."""
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").split()
    for word, rest in instructions():
        if word != "COPY":
            continue
        *sources, target = rest.split()
        for source in sources:
            if source in ignored:
                raise FileNotFoundError(f"the Dockerfile copies {source}, which .dockerignore leaves out")
            if (ROOT / source).is_dir():
                shutil.copytree(ROOT / source, folder / target, ignore=_leaving_out(ignored))
            else:
                (folder / target).mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / source, folder / target / source)


def _leaving_out(ignored: list[str]):
    anywhere = [pattern.removeprefix("**/") for pattern in ignored if pattern.startswith("**/")]
    return lambda _, names: [name for name in names if any(fnmatch.fnmatch(name, each) for each in anywhere)]


if __name__ == "__main__":
    copy(Path(sys.argv[1]))
