"""Text of others in Markdown: names, errors and files are shown as they are and mean nothing to the browser."""

import re

_SPECIAL = re.compile(r"[\\`*_{}\[\]()#+.!|~<>&:@/$^=\"'-]")
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]+")
MAX_LENGTH = 200
"""Longer texts are cut: a name must not fill the page."""


def escape(text: object, most: int = MAX_LENGTH) -> str:
    """`text` as Markdown that renders as exactly this text, on one line and at most `most` characters long.

    Every character that Markdown, its tables or HTML give a meaning becomes a character reference (CommonMark 0.31,
    section 2.5), which is never read as markup.
    """
    line = _CONTROL.sub(" ", str(text))
    if len(line) > most:
        line = line[: most - 1] + "…"
    return _SPECIAL.sub(lambda found: f"&#{ord(found[0])};", line)
