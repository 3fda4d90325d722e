"""Reads the text files of other programs in whatever encoding those programs write."""

import codecs
from pathlib import Path
from typing import Final

_MARKS: Final = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))


def read_text(path: Path) -> str:
    """The text of a file in UTF-8 or UTF-16, with or without a byte order mark, or else in Windows-1252.

    Line ends become newlines. Raises `OSError`.
    """
    return decode(path.read_bytes()).replace("\r\n", "\n").replace("\r", "\n")


def decode(data: bytes) -> str:
    """The text in some bytes, as `read_text` decodes them."""
    encoding = next((encoding for mark, encoding in _MARKS if data.startswith(mark)), None)
    if encoding is None and b"\0" in data[:64]:  # plain Latin letters in UTF-16 have a zero byte each
        encoding = "utf-16-be" if data[:1] == b"\0" else "utf-16-le"
    try:
        return data.decode(encoding or "utf-8", errors="strict" if encoding is None else "replace")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")
