"""`manipnet-serve`: the command line of the server."""

import argparse
import logging
import sys
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from manipnet import __version__

if TYPE_CHECKING:
    from manipnet.config.settings import ServerConfig

DEFAULTS = {
    "host": "127.0.0.1",
    "port": 5555,
    "input_port": 5556,
    "control_port": 5557,
    "osc_port": 39540,
    "page_port": 8080,
    "web_port": 8081,
    "model": "manipnet-small",
    "look_ahead": 0.5,
}
PROVIDERS = ("auto", "cpu", "cuda")
UNITS = ("m", "dm", "cm", "mm", "in")
"""Shown in the help; the values themselves live in `config.ServerConfig`, which a test compares with these."""

EPILOG = """examples:
  manipnet-serve --demo                                   a recorded performance, looped
  manipnet-serve --mesh Box=mug.obj                       bodies left_wrist, right_wrist and Box
  manipnet-serve --rig stage.toml --look-ahead 0.1        bodies as the rig file says
  manipnet-serve --set bodies.left_wrist=3 --mesh 7=mug   streaming ids; a mug of the library
Everything in a rig file's [server] table may be given here too, and then wins."""


def build_parser() -> argparse.ArgumentParser:
    """The options of `manipnet-serve`."""
    parser = argparse.ArgumentParser(
        prog="manipnet-serve",
        description="Synthesise fingers live from tracked wrists and props.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"manipnet {__version__}")
    what = parser.add_argument_group("what is tracked")
    what.add_argument("--demo", action="store_true", help="play the bundled recording through the sockets, for ever")
    what.add_argument("--rig", type=Path, metavar="FILE", help="rig file (TOML): which body is which wrist or prop")
    what.add_argument(
        "--mesh", action="append", default=[], metavar="NAME=FILE", help="the body NAME carries this mesh; repeatable"
    )
    what.add_argument("--objects", type=Path, metavar="FOLDER", help="your own meshes, to choose from; watched")
    what.add_argument("--objects-unit", choices=UNITS, help="their unit (default: m)")
    what.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="any key of a rig file, as there; repeatable"
    )
    what.add_argument(
        "--print-config", action="store_true", help="print what all this comes to, as a rig file, and end"
    )
    what.add_argument("--natnet", metavar="SERVER[:1510]", help="also connect to OptiTrack Motive on that machine")
    what.add_argument("--multicast", action="store_true", help="Motive streams by multicast")
    what.add_argument("--interface", metavar="ADDRESS", help="address of the network card that faces Motive")
    what.add_argument("--up", choices=("y", "z"), help="the axis that Motive streams as up (default: y)")
    how = parser.add_argument_group("how fingers are made")
    _option(how, "model", str, "NAME", "a shipped model, or the folder of one")
    how.add_argument("--provider", choices=PROVIDERS, help="what the network runs on (default: auto, a GPU if it can)")
    _option(how, "look_ahead", float, "SECONDS", "future to wait for, 0 … 0.5; what is missing is forecast")
    where = parser.add_argument_group("where it listens (port 0 takes a free one)")
    _option(where, "host", str, "ADDRESS", "address of this machine to listen on")
    _option(where, "port", int, "PORT", "hands out, ZeroMQ PUB")
    _option(where, "input_port", int, "PORT", "bodies in, ZeroMQ SUB")
    _option(where, "control_port", int, "PORT", "requests, ZeroMQ REP")
    _option(where, "osc_port", int, "PORT", "bodies in, OSC over UDP")
    _option(where, "page_port", int, "PORT", "live page, HTTP and WebSocket")
    _option(where, "web_port", int, "PORT", "hands out to browser clients, WebSocket")
    where.add_argument("--metrics-port", type=int, metavar="PORT", help="Prometheus metrics, HTTP (default: none)")
    where.add_argument("--keys", type=Path, metavar="FOLDER", help="let in only clients with keys: see `manipnet keys`")
    where.add_argument("--allow", action="append", metavar="NETWORK", help="who may send OSC; repeatable")
    where.add_argument("--insecure", action="store_true", help="let any machine in when --host is not loopback")
    also = parser.add_argument_group("what else it sends")
    also.add_argument("--vmc", metavar="HOST[:39539]", help="VMC bones, OSC over UDP")
    also.add_argument("--livelink", metavar="HOST[:54321]", help="Unreal's JSON Live Link, UDP")
    also.add_argument("--takes", type=Path, metavar="FOLDER", help="folder of the recordings (default: takes)")
    also.add_argument(
        "--log-format", choices=("text", "json"), default="text", help="of the log on standard error (%(default)s)"
    )
    also.add_argument("--dump-dir", type=Path, metavar="FOLDER", help="where frames go that led to an internal error")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Serve until SIGINT or SIGTERM; the exit status: 0 after a clean stop, 1 for what cannot be served."""
    arguments = build_parser().parse_args(argv)
    if arguments.print_config:
        return _print_config(arguments)
    # The libraries behind these take a second to load: --help and a mistyped option should not.
    from manipnet.runtime.precompile import Precompiler

    helper = Precompiler()
    helper.start()
    from manipnet.config.settings import ConfigError
    from manipnet.net.curve_keys import KeyFileError
    from manipnet.net.errors import ListenError
    from manipnet.runtime.console import Console
    from manipnet.runtime.signals import stop_on_signals
    from manipnet.server import Server
    from manipnet.synthesis.model.bundle import BundleError
    from manipnet.synthesis.objects.mesh import MeshError

    terminal = Console(as_json=arguments.log_format == "json")
    logging.basicConfig(level=logging.WARNING, handlers=[terminal], force=True)
    if not helper.idle:
        logging.getLogger(__name__).warning("first start here: some 15 s go by while code is compiled, once")
    try:
        with stop_on_signals() as stop:
            server = Server(configure(arguments), terminal.say, helper.wait)
            server.run(stop.is_set)
    except (ConfigError, BundleError, MeshError, KeyFileError, ListenError) as error:
        print(f"manipnet-serve: {error}", file=sys.stderr)
        return 1
    finally:
        terminal.close()
    return 0


def _print_config(arguments: argparse.Namespace) -> int:
    from manipnet.config.settings import ConfigError

    try:
        print(describe(configure(arguments)), end="")
    except ConfigError as error:
        print(f"manipnet-serve: {error}", file=sys.stderr)
        return 1
    return 0


def _option(group: Any, name: str, kind: type, metavar: str, text: str) -> None:
    group.add_argument(
        f"--{name.replace('_', '-')}", type=kind, metavar=metavar, help=f"{text} (default: {DEFAULTS[name]})"
    )


def describe(config: "ServerConfig") -> str:
    """A configuration as a rig file. Raises `ConfigError` for one that no server can be started from."""
    from manipnet.config.rig_writer import rig_text
    from manipnet.config.settings import check

    check(config)
    return rig_text(config)


def configure(arguments: argparse.Namespace) -> "ServerConfig":
    """Defaults, then the rig file's `[server]`, then the command line. Raises `ConfigError`."""
    from manipnet.config.rig_reader import load_rig
    from manipnet.config.settings import ConfigError, ServerConfig, parse_endpoint, parse_network, parse_object
    from manipnet.inputs.natnet import protocol as natnet
    from manipnet.outputs import livelink as livelink_json
    from manipnet.outputs import vmc

    objects = tuple(parse_object(text) for text in arguments.mesh)
    if arguments.rig is not None and (objects or arguments.demo):
        raise ConfigError("--rig names the objects itself; leave out --mesh and --demo, or change a key with --set")
    if arguments.demo:
        from manipnet.demo.player import demo_objects

        objects = demo_objects(objects)
    rig = load_rig(arguments.rig, arguments.set)
    first, *others = rig.actors
    actors = (replace(first, objects=first.objects + objects), *others)
    options: dict[str, Any] = dict(rig.server)
    options |= {name: value for name, value in vars(arguments).items() if value is not None and value is not False}
    if "look_ahead" in options:
        options["look_ahead_s"] = float(options["look_ahead"])
    for name, port in (
        ("natnet", natnet.COMMAND_PORT),
        ("vmc", vmc.DEFAULT_PORT),
        ("livelink", livelink_json.DEFAULT_PORT),
    ):
        if name in options:
            options[name] = parse_endpoint(options[name], port)
    if "allow" in options:
        options["allow"] = tuple(parse_network(text) for text in options["allow"])
    known = {field.name for field in fields(ServerConfig)}
    return ServerConfig(actors, **{name: value for name, value in options.items() if name in known})


if __name__ == "__main__":
    sys.exit(main())
