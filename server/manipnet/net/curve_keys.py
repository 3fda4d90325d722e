"""Keys for ZeroMQ's CURVE encryption: the server's pair, a pair for each client, and the list of allowed clients.

They are in one folder: `server.toml` (secret), `NAME.toml` for each client (secret, to be moved to the client's
machine), and `clients.allow`, with one line `public-key name` for each client. Once its line is deleted, a client
cannot connect again.
"""

import os
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

import zmq

SERVER_FILE = "server.toml"
ALLOW_FILE = "clients.allow"
KEY_CHARS = 40
MAX_FILE_BYTES = 1 << 20


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


def make_server_keys(folder: Path) -> ServerKeys:
    """Make the server's pair in `folder`. Raises `KeyFileError` if there is one already."""
    folder.mkdir(parents=True, exist_ok=True)
    pair = _new_pair()
    _write_secret(folder / SERVER_FILE, {"public": pair.public, "secret": pair.secret})
    (folder / ALLOW_FILE).touch()
    return ServerKeys(pair, folder / ALLOW_FILE)


def make_client_keys(folder: Path, name: str) -> Path:
    """Make a client's file in `folder` and add the client to the list. Raises `KeyFileError`."""
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}", name) or f"{name}.toml" == SERVER_FILE:
        raise KeyFileError(
            f"{name!r} cannot be the name of a client; it must be 1 to 64 letters, digits, '_', '-' and '.', begin "
            "with a letter or digit, and not be 'server'"
        )
    server, pair = read_server_keys(folder), _new_pair()
    path = folder / f"{name}.toml"
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
    values = _read(path, "public", "secret")
    return ServerKeys(KeyPair(values["public"], values["secret"]), folder / ALLOW_FILE)


def read_client_keys(path: Path) -> ClientKeys:
    """Read a client's file. Raises `KeyFileError`."""
    if not path.exists():
        raise KeyFileError(f"{path} does not exist; `manipnet keys make NAME` makes it on the server")
    values = _read(path, "public", "secret", "server_public")
    return ClientKeys(path.stem, KeyPair(values["public"], values["secret"]), values["server_public"])


def read_allow_list(path: Path) -> dict[str, str]:
    """The names of the allowed clients by public key. Empty lines and lines that begin with `#` are ignored.

    Raises `KeyFileError`.
    """
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


def _new_pair() -> KeyPair:
    if not zmq.has("curve"):
        raise KeyFileError("this build of ZeroMQ has no CURVE encryption; install the pyzmq wheel from PyPI")
    public, secret = zmq.curve_keypair()
    return KeyPair(public.decode(), secret.decode())


def _write_secret(path: Path, values: dict[str, str]) -> None:
    """Write a TOML file that only its owner can read. Z85 text has no quotes or backslashes, so nothing is escaped."""
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        raise KeyFileError(f"{path} already exists; delete it first to replace its key") from None
    with os.fdopen(handle, "w", encoding="ascii") as file:
        file.writelines(f'{key} = "{value}"\n' for key, value in values.items())


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
