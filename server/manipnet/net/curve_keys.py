"""Keys for ZeroMQ's CURVE encryption: the server's pair, a pair for each client, and the list of allowed clients.

They are in one folder: `server.toml` (secret), `NAME.toml` for each client (secret, to be moved to the client's
machine), and `clients.allow`, with one line `public-key name` for each client. Once its line is deleted, a client
cannot connect again.
"""

import os
import re
import stat
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from manipnet.common.atomic_file import replacing
from manipnet.common.file_names import is_device

SERVER_FILE = "server.toml"
ALLOW_FILE = "clients.allow"
KEY_CHARS = 40
MAX_FILE_BYTES = 1 << 20
_NOBODY_ELSE, _NOBODY_ELSE_WRITES = 0o077, 0o022
"""Permissions that others must not have: for a secret, and for the list of allowed clients."""


class KeyFileError(ValueError):
    """Keys cannot be read or made. The text names the file, what is wrong and the remedy."""


@dataclass(frozen=True, slots=True)
class KeyPair:
    """A CURVE key pair, each key as 40 characters of Z85 text."""

    public: str
    secret: str

    def __repr__(self) -> str:
        return f"KeyPair(public={self.public!r})"  # the secret must not appear in a log


@dataclass(frozen=True, slots=True)
class ServerKeys:
    """The server's own pair, and the file that lists the allowed clients."""

    pair: KeyPair
    allow_file: Path


@dataclass(frozen=True, slots=True)
class ClientKeys:
    """A client's own pair, and the public key of its server."""

    name: str
    pair: KeyPair
    server_public: str


def make_server_keys(folder: Path, replace: bool = False) -> ServerKeys:
    """Make the server's pair in `folder`. Raises `KeyFileError` if there is one already that is not to be replaced."""
    folder.mkdir(parents=True, exist_ok=True)
    pair = _new_pair()
    if replace:
        (folder / SERVER_FILE).unlink(missing_ok=True)
    _write_secret(folder / SERVER_FILE, {"public": pair.public, "secret": pair.secret})
    _create_private(folder / ALLOW_FILE, os.O_APPEND).close()
    return ServerKeys(pair, folder / ALLOW_FILE)


def make_client_keys(folder: Path, name: str, replace: bool = False) -> Path:
    """Make a client's file in `folder` and add the client to the list. Raises `KeyFileError`.

    With `replace`, the keys that the client had before are revoked.
    """
    usable = re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}", name) and not is_device(name)
    if not usable or f"{name}.toml" == SERVER_FILE:
        raise KeyFileError(
            f"{name!r} cannot be the name of a client; it must be 1 to 64 letters, digits, '_', '-' and '.', begin "
            "with a letter or digit, and not be 'server' or a device of Windows such as 'con'"
        )
    server, pair = read_server_keys(folder), _new_pair()
    path = folder / f"{name}.toml"
    if replace:
        path.unlink(missing_ok=True)
        _revoke(folder / ALLOW_FILE, name)
    _write_secret(
        path, {"name": name, "public": pair.public, "secret": pair.secret, "server_public": server.pair.public}
    )
    with (folder / ALLOW_FILE).open("a", encoding="ascii") as allow:
        allow.write(f"{pair.public} {name}\n")
    return path


def read_server_keys(folder: Path) -> ServerKeys:
    """The server's keys in `folder`. Raises `KeyFileError`."""
    path = folder / SERVER_FILE
    if not path.exists():
        raise KeyFileError(f"{path} does not exist; `manipnet keys make server` makes it")
    _check_mode(path, _NOBODY_ELSE)
    values = _read(path, "public", "secret")
    return ServerKeys(KeyPair(values["public"], values["secret"]), folder / ALLOW_FILE)


def read_client_keys(path: Path) -> ClientKeys:
    """Read a client's file. Raises `KeyFileError`."""
    if not path.exists():
        raise KeyFileError(f"{path} does not exist; `manipnet keys make NAME` makes it on the server")
    _check_mode(path, _NOBODY_ELSE)
    values = _read(path, "public", "secret", "server_public")
    return ClientKeys(path.stem, KeyPair(values["public"], values["secret"]), values["server_public"])


def read_allow_list(path: Path) -> dict[str, str]:
    """The names of the allowed clients by public key. Empty lines and lines that begin with `#` are ignored.

    Raises `KeyFileError`, also if other users of this machine may change the list.
    """
    _check_mode(path, _NOBODY_ELSE_WRITES)
    try:
        lines = path.read_bytes()[:MAX_FILE_BYTES].decode("ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise KeyFileError(f"cannot read {path}: {error}; it must have one `public-key name` per line") from None
    listed = {}
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith("#"):
            continue
        key, _, name = line.strip().partition(" ")
        if not _is_key(key):
            raise KeyFileError(
                f"{path}:{number}: the line must be `public-key name`, with a public key of {KEY_CHARS} characters"
            )
        listed[key] = name.strip() or "unnamed"
    return listed


def _revoke(allow_file: Path, name: str) -> None:
    """Take the keys of a client off the list."""
    lines = allow_file.read_text(encoding="ascii").splitlines(keepends=True)
    with replacing(allow_file) as file:
        file.writelines(line.encode("ascii") for line in lines if line.strip().partition(" ")[2].strip() != name)


def _new_pair() -> KeyPair:
    import zmq  # reading keys, and the command line about keys, take no ZeroMQ

    if not zmq.has("curve"):
        raise KeyFileError("this build of ZeroMQ has no CURVE encryption; install the pyzmq wheel from PyPI")
    public, secret = zmq.curve_keypair()
    return KeyPair(public.decode(), secret.decode())


def _write_secret(path: Path, values: dict[str, str]) -> None:
    """Write a TOML file that only its owner can read. Z85 text has no quotes or backslashes, so nothing is escaped."""
    try:
        file = _create_private(path, os.O_EXCL)
    except FileExistsError:
        raise KeyFileError(f"{path}: already exists; give another name, or --force to replace it") from None
    with file:
        file.writelines(f'{key} = "{value}"\n' for key, value in values.items())


def _create_private(path: Path, how: int) -> TextIO:
    """Create or open a file that only its owner can use, whatever the umask."""
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | how, 0o600)
    if os.name == "posix":
        os.fchmod(handle, 0o600)
    return os.fdopen(handle, "w", encoding="ascii")


def _check_mode(path: Path, forbidden: int) -> None:
    """Raise `KeyFileError` if other users of this machine have one of the `forbidden` permissions; not on Windows."""
    if os.name != "posix" or not path.exists():
        return
    mode = stat.S_IMODE(path.stat().st_mode)
    if mode & forbidden:
        what = "change" if mode & 0o022 else "read"
        raise KeyFileError(f"other users of this machine can {what} {path} (mode {mode:o}); run: chmod 600 {path}")


def _read(path: Path, *keys: str) -> dict[str, str]:
    try:
        values = tomllib.loads(path.read_bytes()[:MAX_FILE_BYTES].decode("ascii"))
    except (OSError, ValueError) as error:
        raise KeyFileError(f"cannot read {path}: {error}") from None
    for key in keys:
        if not _is_key(values.get(key)):
            raise KeyFileError(f"{path} has no key {key!r} of {KEY_CHARS} Z85 characters; make it again")
    return values


def _is_key(text: object) -> bool:
    if not isinstance(text, str) or len(text) != KEY_CHARS:
        return False
    return not set(text) - _Z85


_Z85 = frozenset("0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ.-:+=^!/*?&<>()[]{}@%$#")
