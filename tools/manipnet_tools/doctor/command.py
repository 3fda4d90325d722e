"""`manipnet doctor`: says why no bodies arrive. It asks the running server, or else listens in its place."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from manipnet.common.command_line import Parser
from manipnet.common.options import ConfigError, Option
from manipnet.config.files import require_file
from manipnet.config.flags import add_flags, read_flags
from manipnet.config.settings import (
    ServerConfig,
    all_options,
    control_endpoint,
    default_actor,
    input_options,
    server_config,
)
from manipnet.net.curve_keys import KeyFileError
from manipnet.runtime.diagnosis.finding import Finding
from manipnet_tools.commands.options import DEFAULT_SERVER

EXAMPLES = (
    "                                listen where the server would, for 5 s, or ask the servers that run here",
    "--rig stage.toml                also report which bodies of the rig are missing",
    "--natnet 192.168.1.5            also ask Motive at this address",
    "--server 192.168.1.7            ask the server on another machine",
)


def build_parser() -> Parser:
    """The options of `manipnet doctor`; those of the server have the server's defaults."""
    parser = Parser(
        "manipnet doctor",
        "Say why no tracked bodies arrive, and what to do. Asks the servers that run on this machine; without one, "
        "listens\nwhere it would listen.",
        EXAMPLES,
    )
    parser.add_argument("--server", metavar="HOST[:PORT]", help=f"ask this server (default: {DEFAULT_SERVER})")
    parser.add_argument("--keys", type=Path, metavar="FILE", help="your key file, for a server that requires keys")
    parser.add_argument("--rig", type=Path, metavar="FILE", help="the rig file of the server, to compare bodies with")
    parser.add_argument("--seconds", type=float, default=5.0, help="how long to listen (default: %(default)s)")
    add_flags(parser, _server_options())
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Print what was found. The exit status is 0 if there is no problem, and 1 if there is one."""
    options = build_parser().parse_args(argv)
    try:
        config = _configuration(options)
        if options.server is not None:
            control_endpoint(options.server)
        require_file(options.keys)
        from manipnet_tools.doctor.examination import examine  # its libraries take a second to load

        findings = examine(config, options.server, options.keys, options.seconds)
    except (ConfigError, KeyFileError) as error:
        findings = [Finding("problem", str(error), "correct the file or the option")]
    for finding in findings:
        print(f"{finding.level:8}{finding.text}")
        if finding.remedy:
            print(f"{'':8}→ {finding.remedy}")
    return int(any(finding.level == "problem" for finding in findings))


def _configuration(options: argparse.Namespace) -> ServerConfig:
    """The server's configuration. Raises `ConfigError`."""
    from manipnet.config.rig_reader import Rig, load_rig  # loads NumPy, for which `--help` does not wait

    rig = Rig((default_actor(),)) if options.rig is None else load_rig(options.rig)
    values = rig.server | read_flags(options, _server_options())
    return server_config(rig.actors, values)


def _server_options() -> list[Option]:
    options = all_options()
    return [options["host"], options["allow"], *input_options()]


if __name__ == "__main__":
    sys.exit(main())
