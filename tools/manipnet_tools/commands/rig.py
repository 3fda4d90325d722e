"""`manipnet rig`: write a rig file from what is heard, and show what a configuration comes to."""

import argparse
import logging
import sys
import threading
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from manipnet import cli
from manipnet.config.rig_reader import parse_rig
from manipnet.config.rig_writer import replace_file
from manipnet.config.settings import BodyKey, ConfigError, ServerConfig, parse_endpoint
from manipnet.inputs.natnet.client import NatNetBodies
from manipnet.inputs.natnet.protocol import COMMAND_PORT
from manipnet.inputs.osc.receiver import OscBodies
from manipnet.inputs.zeromq import ZmqBodies
from manipnet.net.errors import ListenError
from manipnet.telemetry import Telemetry
from manipnet_tools.commands.rig_guess import Listener, guess, rig_of

EPILOG = """examples:
  manipnet rig init stage.toml                            listen to ZeroMQ and OSC for 3 s; wave your hands
  manipnet rig init stage.toml --natnet 192.168.1.5       and to Motive
  manipnet rig init stage.toml --left-wrist 3 --right-wrist 4
  manipnet rig show --rig stage.toml --look-ahead 0.1     what manipnet-serve makes of these options"""


def build_parser() -> argparse.ArgumentParser:
    """The options of `manipnet rig`."""
    defaults = ServerConfig(())
    parser = argparse.ArgumentParser(
        prog="manipnet rig",
        description="Write a rig file from what is heard, or show what a configuration comes to.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    init = verbs.add_parser("init", help="listen for a few seconds and write a rig file")
    init.add_argument("file", type=Path, metavar="FILE", help="the rig file to write")
    init.add_argument("--force", action="store_true", help="replace a file that is there; it stays as FILE.bak")
    init.add_argument("--seconds", type=float, default=3.0, help="how long to listen (%(default)s)")
    init.add_argument("--left-wrist", metavar="BODY", help="streaming id or name, if it cannot be guessed")
    init.add_argument("--right-wrist", metavar="BODY", help="the same")
    init.add_argument("--host", default=defaults.host, metavar="ADDRESS", help="address to listen on (%(default)s)")
    init.add_argument("--input-port", type=int, default=defaults.input_port, metavar="PORT", help="(%(default)s)")
    init.add_argument("--osc-port", type=int, default=defaults.osc_port, metavar="PORT", help="(%(default)s)")
    init.add_argument("--natnet", metavar="SERVER[:1510]", help="also connect to OptiTrack Motive there")
    init.add_argument("--multicast", action="store_true", help="Motive streams by multicast")
    init.add_argument("--interface", metavar="ADDRESS", help="address of the network card that faces Motive")
    verbs.add_parser("show", help="print the effective configuration", add_help=False)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Do what the arguments say; the exit status."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments[:1] == ["show"]:  # its options are those of the server
        print(cli.describe(cli.configure(cli.build_parser().parse_args(arguments[1:]))), end="")
        return 0
    init(build_parser().parse_args(arguments))
    return 0


def init(options: argparse.Namespace) -> None:
    """Listen and write. Raises `ConfigError`, and then no file has changed."""
    path: Path = options.file
    if path.exists() and not options.force:
        raise ConfigError(f"{path} is there already; --force replaces it, and keeps it as {path.name}.bak")
    said = {"left_wrist": options.left_wrist, "right_wrist": options.right_wrist}
    wrists = {part: _key(text) for part, text in said.items() if text is not None}
    listener = _listen(options)
    bodies = list(listener.bodies.values())
    if not bodies and not wrists:
        raise ConfigError(f"nothing arrived within {options.seconds:g} s; `manipnet doctor` says why")
    found = guess(bodies, wrists)
    text = rig_of(found, _server(options))
    parse_rig(text, path.parent, str(path))
    replaced = path.exists()
    backup = replace_file(path, text)
    for part, (key, why) in found.wrists.items():
        print(f"{part}: {key} ({why})")
    print("other bodies: " + (", ".join(str(body.key) for body in found.others) or "none"))
    print(f"wrote {path}" + (f"; what was there is in {backup}" if replaced else ""))


def _listen(options: argparse.Namespace) -> Listener:
    """Everything that arrives in the time given. Raises `ConfigError` where it cannot listen."""
    listener, telemetry = Listener(), Telemetry()
    receivers: list[Any] = [
        ZmqBodies(listener, telemetry, options.host, options.input_port),
        OscBodies(listener, telemetry, options.host, options.osc_port),
    ]
    if options.natnet is not None:
        host, port = parse_endpoint(options.natnet, COMMAND_PORT)
        kind = {"multicast": options.multicast, "interface": options.interface}
        receivers.append(NatNetBodies(listener, telemetry, host, port, **kind))
    logging.getLogger("manipnet.inputs").setLevel(logging.ERROR)
    with ExitStack() as opened:
        for receiver in receivers:
            try:
                receiver.start()
            except ListenError as error:
                raise ConfigError(f"{error} (a server that runs here has the port: stop it first)") from None
            opened.callback(receiver.stop)
            print(f"listening on {receiver.address}", flush=True)
        print(f"wave both hands for {options.seconds:g} s, the right one more …", flush=True)
        threading.Event().wait(options.seconds)
    return listener


def _key(text: str) -> BodyKey:
    return int(text) if text.isdecimal() else text


def _server(options: argparse.Namespace) -> dict[str, object]:
    """What of the command line the server will need too."""
    defaults = vars(build_parser().parse_args(["init", "x"]))
    keys = ("host", "input_port", "osc_port", "natnet", "multicast", "interface")
    return {key: getattr(options, key) for key in keys if getattr(options, key) != defaults[key]}
