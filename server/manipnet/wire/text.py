"""Reads names that a sender did not write as UTF-8."""

import unicodedata
from collections.abc import Collection
from typing import Final

ENCODINGS: Final = ("cp1252", "cp932", "cp1250", "cp1251", "gb18030", "euc-kr", "latin-1")
"""What programs on Windows write, beside UTF-8. The bytes do not tell which it is."""


def read_text(raw: bytes, expected: Collection[object] = ()) -> str:
    """The text of some bytes: UTF-8, or else the encoding that gives one of the `expected` names, or else one whose
    text looks like a name."""
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        pass
    texts = [text for encoding in ENCODINGS if (text := _decode(raw, encoding)) is not None]
    wanted = next((text for text in texts if text in expected), None)
    return wanted or next((text for text in texts if _is_name(text)), texts[-1])


def _decode(raw: bytes, encoding: str) -> str | None:
    try:
        return raw.decode(encoding)
    except UnicodeDecodeError:
        return None


def _is_name(text: str) -> bool:
    """Whether every character beyond ASCII is a letter, a mark or a digit."""
    return text.isprintable() and all(char.isascii() or unicodedata.category(char)[0] in "LMN" for char in text)
