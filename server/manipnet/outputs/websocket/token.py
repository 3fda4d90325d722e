"""The token that pages and programs of other machines show before they receive hands over WebSocket."""

import hmac
import os
import re
import stat
from pathlib import Path
from typing import Final

from websockets.datastructures import Headers

from manipnet.common.options import ConfigError

SUBPROTOCOL: Final = "manipnet"
PREFIX: Final = "manipnet.token."
"""A browser can send no header of its own, but it names subprotocols: the one of the server, and the token."""
_FORM: Final = re.compile(r"[A-Za-z0-9_-]{20,200}")


def read_token(path: Path) -> str:
    """The token in a file. Raises `ConfigError` if it cannot be read, is too weak, or others can read it."""
    try:
        mode, text = stat.S_IMODE(path.stat().st_mode), path.read_text(encoding="ascii").strip()
    except (OSError, ValueError) as error:
        raise ConfigError(f"cannot read the token: {error}") from None
    if os.name == "posix" and mode & 0o077:
        raise ConfigError(f"other users of this machine can read {path} (mode {mode:o}); run: chmod 600 {path}")
    if _FORM.fullmatch(text) is None:
        raise ConfigError(
            f"{path} must hold one token of 20 to 200 letters, digits, - and _; this makes one: "
            'python -c "import secrets; print(secrets.token_urlsafe(24))"'
        )
    return text


def shows_token(headers: Headers, token: str) -> bool:
    """Whether a WebSocket handshake shows this token. Takes the same time wherever a wrong token differs."""
    offered = [each.strip() for value in headers.get_all("Sec-WebSocket-Protocol") for each in value.split(",")]
    tokens = [each.removeprefix(PREFIX) for each in offered if each.startswith(PREFIX)]
    return len(tokens) == 1 and hmac.compare_digest(tokens[0].encode(), token.encode())
