"""`manipnet doctor`: says why no bodies arrive. It asks the running server, or else listens in its place."""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from manipnet.common.options import ConfigError, Option
from manipnet.config.flags import add_flags, read_flags
from manipnet.config.rig_reader import Rig, load_rig
from manipnet.config.settings import all_options, default_actor, input_options, server_config
from manipnet.control.client import ControlClient
from manipnet.control.request import RequestError
from manipnet.net.curve_keys import KeyFileError
from manipnet.runtime.diagnosis.finding import Finding, of_map
from manipnet.runtime.run_file import RunningServer, running_servers
from manipnet_tools.doctor.listening import listen_and_diagnose

ANSWER_S = 2.0


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
        findings = examine(options)
    except (ConfigError, KeyFileError) as error:
        findings = [Finding("problem", str(error), "correct the file or the option")]
    for finding in findings:
        print(f"{finding.level:8}{finding.text}")
        if finding.remedy:
            print(f"{'':8}→ {finding.remedy}")
    return int(any(finding.level == "problem" for finding in findings))


def examine(options: argparse.Namespace) -> list[Finding]:
    """Ask the servers that run here, or listen in their place. Raises `ConfigError` and `KeyFileError`.

    If the options or the rig name a control port, the server there is meant; any other is only mentioned.
    """
    rig = Rig((default_actor(),)) if options.rig is None else load_rig(options.rig)
    values = rig.server | read_flags(options, _server_options())
    config = server_config(rig.actors, values)
    status = ask_status(_address(config.host, config.control_port), options.key)
    if status is not None:
        return of_server(status, f"{config.host}:{config.control_port}")
    others = [server for server in running_servers() if server.addresses.get("control")]
    if others and "control_port" not in values:
        return [finding for server in others for finding in _of_running(server, options.key)]
    mentioned = [
        Finding(
            "note", f"another server runs here (process {each.pid}), with its control at {each.addresses['control']}"
        )
        for each in others
    ]
    return [*mentioned, *listen_and_diagnose(config, options.seconds)]


def of_server(status: Mapping[str, Any], where: str) -> list[Finding]:
    """The server's own findings, from its answer to the request `status`."""
    begin = Finding("ok", f"a server runs here (control {where}); it reports:")
    arrived = ", ".join(f"{count} by {name}" for name, count in status["counters"].get("frames_in", {}).items())
    counted = [Finding("ok", f"frames that arrived: {arrived}")] if arrived else []
    return [begin, *counted, *map(of_map, status.get("doctor", ()))]


def ask_status(address: str, key: Path | None = None) -> dict[str, Any] | None:
    """The `status` of the server at that control address, or None if none answers. Raises `KeyFileError`."""
    try:
        answer = ControlClient(address, key, ANSWER_S).ask("status")
    except (OSError, RequestError):
        return None
    return answer if "counters" in answer else None


def _of_running(server: RunningServer, key: Path | None) -> list[Finding]:
    """The findings of a server that has announced itself."""
    control = server.addresses["control"].removeprefix("tcp://")
    status = ask_status(control.replace("0.0.0.0", "127.0.0.1"), key)
    if status is not None:
        return of_server(status, control)
    text = f"a server runs here (process {server.pid}, control {control}), but does not answer"
    if server.has_keys:
        return [Finding("problem", f"{text} to strangers, since it was started with --keys", "give --key NAME.toml")]
    return [Finding("problem", text, "it is starting, busy or stuck: see its terminal and its log")]


def _address(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def _server_options() -> list[Option]:
    options = all_options()
    return [options["host"], options["control_port"], options["allow"], *input_options()]


if __name__ == "__main__":
    sys.exit(main())
