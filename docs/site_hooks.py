"""MkDocs hooks that let pages link to files of the repository outside `docs/`, such as `../clients/README.md`.

Such a link works as it stands where the repository is browsed. For the site, every file that a page links to becomes
part of it: a Markdown file as a page, any other file as it is. Links are then rewritten to where the files lie there.
"""

import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from posixpath import normpath, relpath

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

LINK = re.compile(r"(\]\()([^)#\s]+)([^)]*\))")
"""The target of a Markdown link or image without its anchor, and what stands around it."""
START_PAGES = (
    "CONTRIBUTING.md",
    "SECURITY.md",
    "RELEASING.md",
    "CODE_OF_CONDUCT.md",
    "CHANGELOG.md",
    "clients/README.md",
)
"""Pages outside `docs/` that the navigation names."""
HOME = {"README.md": "docs/index.md"}
"""What stands for a file on the site."""


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Add the files outside `docs/` that pages link to, and those that these link to in turn."""
    root = Path(config.config_file_path).parent
    waiting = [f"docs/{file.src_uri}" for file in files.documentation_pages()] + list(START_PAGES)
    seen = set(waiting)
    while waiting:
        path = waiting.pop()
        if not path.startswith("docs/"):
            files.append(File.generated(config, path, abs_src_path=str(root / path)))
        if path.endswith(".md"):
            found = {target for _, target in links((root / path).read_text(encoding="utf-8"), path)}
            found = {target for target in found if not target.startswith("docs/") and (root / target).is_file()}
            waiting += found - seen
            seen |= found
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Rewrite links to where the files lie on the site; MkDocs reports those that lead nowhere."""
    here = page.file.src_uri
    path = here if page.file.generated_by else f"docs/{here}"

    def rewritten(match: re.Match[str]) -> str:
        before, target, after = match.groups()
        place = site_place(in_repository(target, path))
        return (
            match[0]
            if files.get_file_from_path(place) is None
            else f"{before}{relpath(place, PurePosixPath(here).parent)}{after}"
        )

    return LINK.sub(rewritten, markdown)


def links(markdown: str, path: str) -> Iterator[tuple[str, str]]:
    """Every relative link of a file, as it stands and as a path of the repository."""
    for _, target, _ in LINK.findall(markdown):
        if ":" not in target:
            yield target, in_repository(target, path)


def in_repository(target: str, path: str) -> str:
    """The path in the repository that a link in the file `path` leads to."""
    place = normpath(f"{PurePosixPath(path).parent}/{target}")
    return HOME.get(place, place)


def site_place(path: str) -> str:
    """Where a file of the repository lies among the sources of the site."""
    return path.removeprefix("docs/")
