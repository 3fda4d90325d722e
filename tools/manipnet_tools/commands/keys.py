"""`manipnet keys`: make and list the keys of a server that other machines can reach."""

import sys
from collections.abc import Sequence
from pathlib import Path

from platformdirs import user_config_path

from manipnet.common.command_line import Parser
from manipnet.net.curve_keys import (
    ALLOW_FILE,
    SERVER_FILE,
    KeyFileError,
    make_client_keys,
    make_server_keys,
    read_allow_list,
    read_server_keys,
)

EXAMPLES = (
    "make server          make the server's own keys, once",
    "make stage-pc        make a client's keys; move stage-pc.toml to that machine",
    "list                 list the clients that may connect",
)


def default_folder() -> Path:
    """The folder of a user's keys."""
    return user_config_path("manipnet", appauthor=False) / "keys"


def build_parser() -> Parser:
    """The options of `manipnet keys`."""
    parser = Parser(
        "manipnet keys",
        "Make and list the keys with which clients may connect over the network.\n"
        "To revoke a client's keys, delete its line in clients.allow.",
        EXAMPLES,
    )
    parser.add_argument(
        "--folder", type=Path, default=default_folder(), help="folder of the keys (default: %(default)s)"
    )
    verbs = parser.add_subparsers(dest="verb", required=True, parser_class=Parser, prog="manipnet keys")
    make = verbs.add_parser("make", help="make the keys of the server or of a client")
    make.add_argument("name", metavar="NAME", help="'server', or a name for the client")
    make.add_argument("--force", action="store_true", help="replace the keys of that name, which then open nothing")
    verbs.add_parser("list", help="show the server's public key and the clients that may connect")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Do what the arguments say. Returns the exit status."""
    parser = build_parser()
    options = parser.parse_args(argv)
    try:
        lines = _make(options.folder, options.name, options.force) if options.verb == "make" else _list(options.folder)
    except (KeyFileError, OSError) as error:
        print(f"manipnet keys: {error}", file=sys.stderr)
        return 1
    print("\n".join(lines))
    return 0


def _make(folder: Path, name: str, force: bool) -> list[str]:
    if name == "server":
        keys = make_server_keys(folder, force)
        return [f"made {folder / SERVER_FILE} (secret; keep it here)", f"public key: {keys.pair.public}"]
    path = make_client_keys(folder, name, force)
    return [f"made {path} (secret; move it to {name})", f"added {name} to {folder / ALLOW_FILE}"]


def _list(folder: Path) -> list[str]:
    server = read_server_keys(folder)
    clients = [f"{key}  {name}" for key, name in read_allow_list(server.allow_file).items()]
    return [f"{server.pair.public}  server", *(clients or ["no client may connect yet: `manipnet keys make NAME`"])]


if __name__ == "__main__":
    sys.exit(main())
