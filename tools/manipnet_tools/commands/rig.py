"""`manipnet rig`: write a rig file from the bodies that arrive, or show a server's configuration."""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from manipnet import cli
from manipnet.common.command_line import Parser
from manipnet.common.options import ConfigError, Option
from manipnet.config.files import require_file
from manipnet.config.flags import add_flags, read_flags
from manipnet.config.settings import BodyKey, all_options, control_endpoint, input_options, server_config
from manipnet_tools.commands.checks import require_new

if TYPE_CHECKING:
    from manipnet_tools.commands.rig_guess import Guess, StreamedBody

EXAMPLES = (
    "init stage.toml                            listen for 3 s and write stage.toml; wave both hands",
    "init stage.toml --natnet 192.168.1.5       listen to OptiTrack Motive too",
    "init stage.toml --server 127.0.0.1         the bodies that a running server receives",
    "init stage.toml --left-wrist 3 --right-wrist 4",
    "show --rig stage.toml --look-ahead 0.1     show the configuration that manipnet-serve would use",
)


def build_parser() -> Parser:
    """The options of `manipnet rig`."""
    parser = Parser(
        "manipnet rig",
        "Write a rig file from the bodies that arrive, or show the configuration of a server.",
        EXAMPLES,
    )
    verbs = parser.add_subparsers(dest="verb", required=True, parser_class=Parser, prog="manipnet rig")
    init = verbs.add_parser("init", help="listen, then write a rig file", description="Listen, then write a rig file.")
    init.add_argument("file", type=Path, metavar="FILE", help="the rig file to write")
    init.add_argument("--force", action="store_true", help="replace a file that exists, and keep it as FILE.bak")
    init.add_argument("--server", metavar="HOST[:PORT]", help="take the bodies that this running server receives")
    init.add_argument("--keys", type=Path, metavar="FILE", help="your key file, for a server that requires keys")
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
    require_new(path, options.force, "the rig file")
    require_file(options.keys)
    given = {"left_wrist": options.left_wrist, "right_wrist": options.right_wrist}
    wrists = {part: _key(text) for part, text in given.items() if text is not None}
    values = read_flags(options, _server_options())
    if options.server is not None:
        control_endpoint(options.server)
    from manipnet.config.rig_reader import parse_rig
    from manipnet.config.rig_writer import replace_file
    from manipnet_tools.commands.rig_guess import guess, rig_of

    bodies = _streamed(options, values)
    if not bodies and not wrists:
        where = f"the server at {options.server} has received no body" if options.server else "nothing arrived"
        raise ConfigError(f"{where} within {options.seconds:g} s; `manipnet doctor` says why")
    found = guess(bodies, wrists)
    text = rig_of(found, _to_write(values))
    parse_rig(text, path.parent, str(path))
    replaced = path.exists()
    backup = replace_file(path, text)
    print("\n".join(report(found)))
    print(f"wrote {path}" + (f"; the file it replaces is now {backup}" if replaced else ""))


def report(found: "Guess") -> list[str]:
    """What was guessed of each body, why, and what to check."""
    from manipnet_tools.commands.rig_guess import likely_mesh

    lines = [f"{part}: {key} ({reason})" for part, (key, reason) in found.wrists.items()]
    for body in found.others:
        mesh = likely_mesh(body.name)
        if mesh is None:
            lines.append(f"prop {body.key}: no mesh is known, so it is a comment in the file; give it its mesh")
        else:
            lines.append(
                f"prop {body.key}: the mesh {mesh} of the library, guessed from its name; "
                "check its shape, size and place, because they decide the grasp"
            )
    return lines


def _streamed(options: argparse.Namespace, values: dict[str, Any]) -> "list[StreamedBody]":
    """The bodies that a running server receives, or that arrive here within some seconds. Raises `ConfigError`."""
    from manipnet_tools.terminal import WARNING, countdown, open_console

    if options.server is None:
        with countdown("wave both hands, the right hand more", options.seconds):
            return _listen(values, options.seconds)
    from manipnet_tools.commands.rig_guess import StreamedBody
    from manipnet_tools.commands.running_server import reach

    console = open_console()
    client, _ = reach(options.server, options.keys, lambda text: console.print(text, style=WARNING))
    senders: Mapping[str, Any] = client.ask("status")["senders"]
    keys = dict.fromkeys((body["id"], body["name"]) for sender in senders.values() for body in sender["bodies"])
    return [StreamedBody(id, name) for id, name in keys]


def _listen(values: dict[str, Any], seconds: float) -> "list[StreamedBody]":
    """Collect the bodies that arrive within some seconds. Raises `ConfigError` if a receiver cannot listen."""
    import logging
    import threading
    from contextlib import ExitStack

    from manipnet.inputs import make_receivers, start_receivers
    from manipnet.net.errors import ListenError
    from manipnet.runtime.run_file import running_servers
    from manipnet.telemetry import Telemetry
    from manipnet_tools.commands.rig_guess import BodyCollector

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
            controls = [each.addresses["control"] for each in running_servers() if "control" in each.addresses]
            remedy = f"; a server runs here and can say what it receives: --server {controls[0]}" if controls else ""
            raise ConfigError(f"{error}{remedy}") from None
        for receiver in receivers.values():
            print(f"listening on {receiver.address}")
        sys.stdout.flush()
        threading.Event().wait(seconds)
    return list(collector.bodies.values())


def _key(text: str) -> BodyKey:
    return int(text) if text.isdecimal() else text


def _server_options() -> list[Option]:
    return [all_options()["host"], *input_options()]


def _to_write(values: dict[str, Any]) -> dict[str, object]:
    """The options that the server will need too, as the rig file holds them."""
    options = all_options()
    return {key: options[key].kind.write(value) for key, value in values.items() if value != options[key].default}
