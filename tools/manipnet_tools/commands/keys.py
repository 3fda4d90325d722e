"""`manipnet keys`: make and list the keys of a server that is not only on loopback."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from platformdirs import user_config_path

from manipnet.net.curve_keys import (
    ALLOW_FILE,
    SERVER_FILE,
    KeyFileError,
    make_client_keys,
    make_server_keys,
    read_allow_list,
    read_server_keys,
)

EPILOG = """examples:
  manipnet keys make server          the server's own keys, once
  manipnet keys make stage-pc        a client: carry stage-pc.toml to that machine, then delete it here
  manipnet keys list                 who may connect
To keep a client out from now on, delete its line in clients.allow."""


def default_folder() -> Path:
    """Where a user's keys are kept."""
    return user_config_path("manipnet", appauthor=False) / "keys"


def main(argv: Sequence[str] | None = None) -> int:
    """Do what the arguments say; the exit status."""
    parser = argparse.ArgumentParser(
        prog="manipnet keys",
        description="Make and list the keys that let clients in over the network.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--folder", type=Path, default=default_folder(), help="where the keys are (%(default)s)")
    verbs = parser.add_subparsers(dest="verb", required=True)
    make = verbs.add_parser("make", help="make the keys of the server or of a client")
    make.add_argument("name", help="'server', or the name of a client")
    verbs.add_parser("list", help="show the server's public key and the clients that may connect")
    options = parser.parse_args(argv)
    try:
        lines = _make(options.folder, options.name) if options.verb == "make" else _list(options.folder)
    except (KeyFileError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    print("\n".join(lines))
    return 0


def _make(folder: Path, name: str) -> list[str]:
    if name == "server":
        keys = make_server_keys(folder)
        return [f"made {folder / SERVER_FILE} (keep it secret)", f"public key: {keys.pair.public}"]
    path = make_client_keys(folder, name)
    return [f"made {path} (secret: carry it to {name}, then delete it here)", f"listed in {folder / ALLOW_FILE}"]


def _list(folder: Path) -> list[str]:
    server = read_server_keys(folder)
    clients = [f"{key}  {name}" for key, name in read_allow_list(server.allow_file).items()]
    return [f"{server.pair.public}  server", *(clients or ["no client may connect yet: `manipnet keys make NAME`"])]


if __name__ == "__main__":
    sys.exit(main())
