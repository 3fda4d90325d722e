"""`manipnet doctor`: says why no bodies arrive. It asks the running server, or else listens in its place."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from manipnet.common.options import ConfigError, Option
from manipnet.config.flags import add_flags, read_flags
from manipnet.config.rig_reader import Rig, load_rig
from manipnet.config.settings import ServerConfig, all_options, default_actor, input_options, server_config
from manipnet.net.curve_keys import KeyFileError
from manipnet.runtime.diagnosis.finding import Finding


def build_parser() -> argparse.ArgumentParser:
    """The options of `manipnet doctor`; those of the server have the server's defaults."""
    parser = argparse.ArgumentParser(
        prog="manipnet doctor",
        usage="manipnet doctor [options]",
        description="Say why no tracked bodies arrive, and what to do. Asks the servers that run on this machine; "
        "without one, listens where it would listen.",
    )
    parser.add_argument("--rig", type=Path, metavar="FILE", help="the rig file of the server, to compare bodies with")
    add_flags(parser, _server_options())
    parser.add_argument("--key", type=Path, metavar="FILE", help="a client's key file, for a server with --keys")
    parser.add_argument("--seconds", type=float, default=5.0, help="how long to listen (default: %(default)s)")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Print what was found. The exit status is 0 if there is no problem, and 1 if there is one."""
    options = build_parser().parse_args(argv)
    try:
        config, port_given = _configuration(options)
        from manipnet_tools.doctor.examination import examine  # its libraries take a second to load

        findings = examine(config, port_given, options.key, options.seconds)
    except (ConfigError, KeyFileError) as error:
        findings = [Finding("problem", str(error), "correct the file or the option")]
    for finding in findings:
        print(f"{finding.level:8}{finding.text}")
        if finding.remedy:
            print(f"{'':8}→ {finding.remedy}")
    return int(any(finding.level == "problem" for finding in findings))


def _configuration(options: argparse.Namespace) -> tuple[ServerConfig, bool]:
    """The server's configuration, and whether its control port was given. Raises `ConfigError`."""
    rig = Rig((default_actor(),)) if options.rig is None else load_rig(options.rig)
    values = rig.server | read_flags(options, _server_options())
    return server_config(rig.actors, values), "control_port" in values


def _server_options() -> list[Option]:
    options = all_options()
    return [options["host"], options["control_port"], options["allow"], *input_options()]


if __name__ == "__main__":
    sys.exit(main())
