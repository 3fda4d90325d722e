"""The tables of the documentation are up to date, and each of them is in some page."""

from manipnet_tools.assets.doc_tables import DOCS, TABLES, with_tables

PAGES = {path: path.read_text(encoding="utf-8") for path in sorted(DOCS.rglob("*.md"))}


def test_the_tables_are_those_of_the_declarations() -> None:
    outdated = [path.name for path, text in PAGES.items() if with_tables(text) != text]
    assert not outdated, "run python -m manipnet_tools.assets.doc_tables"


def test_every_table_is_in_some_page() -> None:
    text = "".join(PAGES.values())
    assert {name for name in TABLES if f"<!-- table {name} -->" in text} == set(TABLES)
