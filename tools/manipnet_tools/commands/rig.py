"""`manipnet rig`: write a rig file from the bodies that arrive, or show a server's configuration."""

import argparse
import logging
import sys
import threading
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from manipnet import cli
from manipnet.common.options import ConfigError, Option
from manipnet.config.flags import add_flags, read_flags
from manipnet.config.rig_reader import parse_rig
from manipnet.config.rig_writer import replace_file
from manipnet.config.settings import BodyKey, all_options, input_options, server_config
from manipnet.inputs import make_receivers, start_receivers
from manipnet.net.errors import ListenError
from manipnet.telemetry import Telemetry
from manipnet_tools.commands.checks import require_folder_of
from manipnet_tools.commands.rig_guess import BodyCollector, guess, rig_of

EPILOG = """examples:
  manipnet rig init stage.toml                            listen for 3 s and write stage.toml; wave both hands
  manipnet rig init stage.toml --natnet 192.168.1.5       listen to OptiTrack Motive too
  manipnet rig init stage.toml --left-wrist 3 --right-wrist 4
  manipnet rig show --rig stage.toml --look-ahead 0.1     show the configuration that manipnet-serve would use"""


def build_parser() -> argparse.ArgumentParser:
    """The options of `manipnet rig`."""
    parser = argparse.ArgumentParser(
        prog="manipnet rig",
        description="Write a rig file from the bodies that arrive, or show the configuration of a server.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    init = verbs.add_parser("init", usage="manipnet rig init FILE [options]", help="listen, then write a rig file")
    init.add_argument("file", type=Path, metavar="FILE", help="the rig file to write")
    init.add_argument("--force", action="store_true", help="replace a file that exists, and keep it as FILE.bak")
    init.add_argument("--seconds", type=float, default=3.0, help="how long to listen (default: %(default)s)")
    for side in ("left", "right"):
        init.add_argument(
            f"--{side}-wrist", metavar="BODY", help=f"streaming id or name of the {side} wrist, if it is not found"
        )
    add_flags(init, _server_options())
    verbs.add_parser("show", help="print the configuration of manipnet-serve for the same options", add_help=False)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Do what the arguments say. Returns the exit status."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments[:1] == ["show"]:  # has the options of manipnet-serve
        print(cli.describe(cli.configure(cli.build_parser().parse_args(arguments[1:]))), end="")
        return 0
    init(build_parser().parse_args(arguments))
    return 0


def init(options: argparse.Namespace) -> None:
    """Listen and write the rig file. Raises `ConfigError`, and then no file has changed."""
    path: Path = options.file
    if path.exists() and not options.force:
        raise ConfigError(f"{path} already exists; --force replaces it, and keeps it as {path.name}.bak")
    require_folder_of(path, "the rig file")
    given = {"left_wrist": options.left_wrist, "right_wrist": options.right_wrist}
    wrists = {part: _key(text) for part, text in given.items() if text is not None}
    values = read_flags(options, _server_options())
    collector = _listen(values, options.seconds)
    bodies = list(collector.bodies.values())
    if not bodies and not wrists:
        raise ConfigError(f"nothing arrived within {options.seconds:g} s; `manipnet doctor` says why")
    found = guess(bodies, wrists)
    text = rig_of(found, _to_write(values))
    parse_rig(text, path.parent, str(path))
    replaced = path.exists()
    backup = replace_file(path, text)
    for part, (key, reason) in found.wrists.items():
        print(f"{part}: {key} ({reason})")
    print("other bodies: " + (", ".join(str(body.key) for body in found.others) or "none"))
    print(f"wrote {path}" + (f"; the file it replaces is now {backup}" if replaced else ""))


def _listen(values: dict[str, Any], seconds: float) -> BodyCollector:
    """Collect the bodies that arrive within some seconds. Raises `ConfigError` if a receiver cannot listen."""
    collector = BodyCollector()
    config = server_config((), values)
    receivers = make_receivers(config.of, collector, Telemetry(), config.host)
    log = logging.getLogger("manipnet.inputs")
    with ExitStack() as opened:
        opened.callback(log.setLevel, log.level)
        log.setLevel(logging.ERROR)
        try:
            start_receivers(receivers, opened)
        except ListenError as error:
            raise ConfigError(f"{error} (if a server runs on this machine, stop it first)") from None
        for receiver in receivers.values():
            print(f"listening on {receiver.address}", flush=True)
        print(f"wave both hands for {seconds:g} s, the right hand more …", flush=True)
        threading.Event().wait(seconds)
    return collector


def _key(text: str) -> BodyKey:
    return int(text) if text.isdecimal() else text


def _server_options() -> list[Option]:
    return [all_options()["host"], *input_options()]


def _to_write(values: dict[str, Any]) -> dict[str, object]:
    """The options that the server will need too, as the rig file holds them."""
    options = all_options()
    return {key: options[key].kind.write(value) for key, value in values.items() if value != options[key].default}
