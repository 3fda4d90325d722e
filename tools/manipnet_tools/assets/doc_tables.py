"""Writes the tables of the documentation that follow from declarations: `python -m manipnet_tools.assets.doc_tables`.

In any page of `docs/`, a table is between the comments `<!-- table NAME -->` and `<!-- end of table -->`, each of which
is separated from it by an empty line.
"""

import re
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Final

from manipnet import inputs, outputs
from manipnet.common.options import HostPort, Protocol
from manipnet.config.settings import all_options

DOCS: Final = Path(__file__).parents[3] / "docs"
_MARKED: Final = re.compile(r"(<!-- table (\w+) -->\n\n).*?(\n<!-- end of table -->)", re.DOTALL)


def options_table() -> str:
    """Every option of the server: its key in a rig file, its flag, its default and its meaning."""
    rows = [
        (f"`{each.key}`", _code(f"{each.flag} {each.kind.metavar}"), _code(each.shown_default), each.help)
        for each in all_options().values()
    ]
    return _table(("key", "on the command line", "default", "meaning"), rows)


def inputs_table() -> str:
    """Every protocol that delivers tracked bodies, its address and its option."""
    rows = [
        (each.summary, _code(_address(each.transport or "", each)), f"`{each.where.flag}`", f"`{each.name}`")
        for each in inputs.INPUTS
    ]
    return _table(("protocol", "default address", "option", "counted as"), rows)


def outputs_table() -> str:
    """Every protocol that sends hands, its port and its option."""
    rows = [
        (
            each.summary,
            str(each.default_port or "-"),
            f"`{each.where.flag}`",
            ", ".join(f"`{label}`" for label in each.labels),
        )
        for each in outputs.OUTPUTS
    ]
    return _table(("protocol", "default port", "option", "counted as"), rows)


TABLES: Final[Mapping[str, Callable[[], str]]] = {
    "options": options_table,
    "inputs": inputs_table,
    "outputs": outputs_table,
}


def with_tables(page: str) -> str:
    """The text of a page with up-to-date tables. Raises `KeyError` for a table that does not exist."""
    return _MARKED.sub(lambda match: f"{match[1]}{TABLES[match[2]]()}{match[3]}", page)


def main() -> int:
    """Rewrite the pages whose tables are out of date."""
    for path in sorted(DOCS.rglob("*.md")):
        before = path.read_text(encoding="utf-8")
        after = with_tables(before)
        if after != before:
            path.write_text(after, encoding="utf-8")
            print(f"wrote {path}")
    return 0


def _address(transport: str, protocol: Protocol) -> str:
    return "" if isinstance(protocol.where.kind, HostPort) else f"{transport}://127.0.0.1:{protocol.default_port}"


def _table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    header = list(header)
    lines = [header, ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _code(text: str) -> str:
    return f"`{text.strip()}`" if text.strip() else "-"


if __name__ == "__main__":
    sys.exit(main())
