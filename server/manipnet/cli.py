"""`manipnet-serve`: the command line of the server.

`--help` and a mistyped option answer at once, so the libraries of a running server load only when one is to run.
"""

import argparse
import logging
import sys
import threading
import webbrowser
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from manipnet import __version__, inputs, outputs
from manipnet.common.command_line import Parser
from manipnet.common.options import ConfigError, options_of
from manipnet.common.text_output import accept_any_text
from manipnet.config.files import check_files
from manipnet.config.flags import add_flags, read_flags
from manipnet.config.settings import (
    FILES,
    SERVER,
    SYNTHESIS,
    TRACKED,
    ServerConfig,
    all_options,
    check,
    parse_object,
    server_config,
)
from manipnet.runtime.memory import check_address_space, leave_out_linear_algebra, share_arenas
from manipnet.runtime.start_progress import StartProgress
from manipnet.synthesis.hand.shipped_files import hand_file
from manipnet.synthesis.model.shipped import BundleError, version_text

if TYPE_CHECKING:
    from manipnet.runtime.console import Console

_log = logging.getLogger(__name__)

EXAMPLES = (
    "--demo --open                           play a recorded performance, and show it in the browser",
    "--mesh Box=mug.obj                      track the bodies left_wrist, right_wrist and Box",
    "--rig stage.toml --look-ahead 0.1       read from a file which bodies are tracked",
    "--set bodies.left_wrist=3 --mesh 7=mug  name bodies by streaming id; use a mug of the library",
)
ABOUT = """Synthesise finger motion live from tracked wrists and objects.

All options but --rig, --mesh, --hand, --set, --print-config, --open and --log-format may also be in the [server] table
of the rig file; the command line overrides the file."""


def build_parser() -> Parser:
    """The options of `manipnet-serve`."""
    parser = Parser("manipnet-serve", ABOUT, EXAMPLES)
    parser.add_argument(
        "--version", action=_Version, nargs=0, help="print the version and the licences of the models, and exit"
    )
    parser.add_argument(
        "--open", action="store_true", help="open the live page in the browser when the server is ready"
    )
    groups = {title: parser.add_argument_group(title) for title in (TRACKED, SYNTHESIS)}
    tracked = groups[TRACKED]
    tracked.add_argument("--rig", type=Path, metavar="FILE", help="rig file: which body is which wrist or prop")
    tracked.add_argument(
        "--mesh", action="append", default=[], metavar="NAME=FILE", help="body NAME carries the mesh FILE; repeatable"
    )
    tracked.add_argument(
        "--hand",
        type=hand_file,
        metavar="HAND.json",
        help="also solve the first actor's hands on this avatar's hand, or on a shipped one: generic, adult or child",
    )
    tracked.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="override a key of the rig file; repeatable"
    )
    tracked.add_argument(
        "--print-config", action="store_true", help="print the resulting configuration as a rig file, and exit"
    )
    for title, protocols in (("where tracked bodies come from", inputs.INPUTS), ("where hands go", outputs.OUTPUTS)):
        group = parser.add_argument_group(title)
        for protocol in protocols:
            add_flags(group, options_of(protocol.options))
    groups |= {title: parser.add_argument_group(title) for title in (SERVER, FILES)}
    for each in options_of(ServerConfig):
        add_flags(groups[each.group], [each])
    groups[FILES].add_argument(
        "--log-format",
        choices=("text", "json"),
        default="text",
        help="format of the log on standard error (default: %(default)s)",
    )
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Serve until SIGINT or SIGTERM. The exit status is 0 after a clean stop, and 1 if the server cannot run."""
    accept_any_text()
    arguments = build_parser().parse_args(argv)
    try:
        config = configure(arguments)
        if arguments.print_config:
            print(describe(config), end="")
            return 0
        check(config)
        check_files(config)
        check_address_space()
    except (ConfigError, BundleError) as error:
        print(f"manipnet-serve: {error}", file=sys.stderr)
        return 1
    return _serve(config, arguments.log_format == "json", arguments.open)


def configure(arguments: argparse.Namespace) -> ServerConfig:
    """The configuration of the parsed arguments: the rig file, overridden by the flags. Raises `ConfigError`."""
    flags = read_flags(arguments, all_options().values())
    objects = tuple(parse_object(text) for text in arguments.mesh)
    demo = flags.get("demo", False)
    if arguments.rig is not None and (objects or demo):
        raise ConfigError(
            "--rig cannot be combined with --mesh or --demo, since the rig file names the objects; "
            "change a key of it with --set"
        )
    if demo:
        from manipnet.demo.player import demo_objects

        objects = demo_objects(objects)
    from manipnet.config.rig_reader import load_rig  # loads NumPy, for which a wrong flag does not wait

    rig = load_rig(arguments.rig, arguments.set)
    first, *others = rig.actors
    first = replace(first, objects=first.objects + objects, hand=arguments.hand or first.hand)
    actors = (first, *others)
    return server_config(actors, rig.server | flags, arguments.rig)


def describe(config: ServerConfig) -> str:
    """A configuration as the text of a rig file. Raises `ConfigError` if no server can be started from it."""
    from manipnet.config.rig_writer import rig_text

    check(config)
    return rig_text(config)


class _Version(argparse.Action):
    """Prints the version and the licences, which are read only then."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(version_text("manipnet", __version__))
        parser.exit()


def _serve(config: ServerConfig, json_log: bool, opens_page: bool) -> int:
    from manipnet.runtime.console import Console
    from manipnet.runtime.log_file import open_log_file

    console = Console(as_json=json_log, log_file=open_log_file())
    logging.basicConfig(level=logging.WARNING, handlers=[console], force=True)
    _log.setLevel(logging.INFO)
    console.show("starting …")
    try:
        return _serve_with(console, config, opens_page)
    finally:
        console.close()


def _serve_with(console: "Console", config: ServerConfig, opens_page: bool) -> int:
    share_arenas()
    with StartProgress(console.show, _log.info, console.is_terminal) as progress:
        leave_out_linear_algebra()
        from manipnet.runtime.precompile import Precompiler

        precompiler = Precompiler()
        precompiler.start()
        if precompiler.idle:
            progress.end()
        else:
            progress.begin()  # what is kept is that of another version
        from manipnet.net.curve_keys import KeyFileError
        from manipnet.net.errors import ListenError
        from manipnet.runtime.signals import stop_on_signals
        from manipnet.server import Server
        from manipnet.synthesis.hand.profile import ProfileError
        from manipnet.synthesis.objects.mesh import MeshError

        def say(line: str) -> None:
            progress.end()
            if line.startswith("ready "):
                console.show("")
            console.say(line)
            if opens_page and line.startswith("ready "):
                open_page(line)

        try:
            with stop_on_signals() as stop:
                server = Server(config, say, precompiler.wait, console.show)
                server.run(stop.is_set)
        except (ConfigError, BundleError, MeshError, ProfileError, KeyFileError, ListenError) as error:
            progress.end()
            console.show("")
            print(f"manipnet-serve: {error}", file=sys.stderr)
            return 1
    return 0


def open_page(ready: str) -> None:
    """Open the live page of the line `ready …` in the browser, without waiting for it."""
    words = ready.split()[1:]
    address = dict(zip(words[::2], words[1::2], strict=True))["page"]
    threading.Thread(target=webbrowser.open, args=(address,), name="browser", daemon=True).start()


if __name__ == "__main__":
    sys.exit(main())
