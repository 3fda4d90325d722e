"""`manipnet doctor`: why nothing arrives. Listens where the server would, or asks the server that already does."""

import argparse
import errno
import logging
import os
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from manipnet.config.rig_reader import load_rig
from manipnet.config.settings import (
    WRISTS,
    ActorConfig,
    BodyKey,
    ConfigError,
    ServerConfig,
    default_actor,
    parse_endpoint,
)
from manipnet.control.client import ControlClient
from manipnet.control.request import RequestError
from manipnet.inputs.natnet.client import NatNetBodies
from manipnet.inputs.natnet.protocol import COMMAND_PORT
from manipnet.inputs.osc.receiver import OscBodies
from manipnet.inputs.zeromq import ZmqBodies
from manipnet.net.curve_keys import KeyFileError
from manipnet.net.errors import ListenError
from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import BodyFrame
from manipnet_tools.doctor import from_status as self_report
from manipnet_tools.doctor import other_interfaces as elsewhere
from manipnet_tools.doctor.diagnosis import Finding, Heard, SourceHeard, diagnose

ANSWER_S = 2.0
MAX_SOURCES = 32


class Listener(logging.Handler):
    """Takes frames as a sink and complaints as a log handler, from any thread."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._news = threading.Lock()
        self.sources: dict[str, SourceHeard] = {}
        self.complaints: list[str] = []

    def __call__(self, frame: BodyFrame) -> None:
        with self._news:
            if frame.source in self.sources or len(self.sources) < MAX_SOURCES:
                self.sources.setdefault(frame.source, SourceHeard()).add(frame)

    def emit(self, record: logging.LogRecord) -> None:
        self.complaints = [*self.complaints[-19:], record.getMessage()]


def build_parser() -> argparse.ArgumentParser:
    """The options of `manipnet doctor`; the addresses default to the server's."""
    defaults = ServerConfig(())
    parser = argparse.ArgumentParser(prog="manipnet doctor", description="Say why no tracked bodies arrive.")
    parser.add_argument("--rig", type=Path, metavar="FILE", help="the rig file the server is to be started with")
    parser.add_argument("--host", default=defaults.host, metavar="ADDRESS", help="address to listen on (%(default)s)")
    parser.add_argument("--input-port", type=int, default=defaults.input_port, metavar="PORT", help="(%(default)s)")
    parser.add_argument("--osc-port", type=int, default=defaults.osc_port, metavar="PORT", help="(%(default)s)")
    parser.add_argument("--control-port", type=int, default=defaults.control_port, metavar="PORT", help="(%(default)s)")
    parser.add_argument("--natnet", metavar="SERVER[:1510]", help="also connect to OptiTrack Motive there")
    parser.add_argument("--multicast", action="store_true", help="Motive streams by multicast")
    parser.add_argument("--interface", metavar="ADDRESS", help="address of the network card that faces Motive")
    parser.add_argument("--key", type=Path, metavar="FILE", help="a client's keys, to ask a server that wants some")
    parser.add_argument("--seconds", type=float, default=5.0, help="how long to listen (%(default)s)")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Print what was found; the exit status: 0 when all is well, 1 when something is not."""
    options = build_parser().parse_args(argv)
    try:
        findings = examine(options)
    except (ConfigError, KeyFileError) as error:
        findings = [Finding("problem", str(error), "mend the file or the option")]
    for finding in findings:
        print(f"{finding.level:8}{finding.text}")
        if finding.remedy:
            print(f"{'':8}→ {finding.remedy}")
    return int(any(finding.level == "problem" for finding in findings))


def examine(options: argparse.Namespace) -> list[Finding]:
    """Listen or ask, and reason about it; raises `ConfigError` for a wrong rig file or option."""
    actors = load_rig(options.rig).actors if options.rig is not None else (default_actor(),)
    running = ask_status(options.host, options.control_port, options.key)
    if running is not None:
        return self_report.of_server(running, f"{options.host}:{options.control_port}")
    listener, telemetry = Listener(), Telemetry()
    log = logging.getLogger("manipnet.inputs")
    findings: list[Finding] = []
    addresses: dict[str, str] = {}
    receivers, motive = _receivers(options, listener, telemetry)
    with ExitStack() as opened:
        log.addHandler(listener)
        opened.callback(log.removeHandler, listener)
        for what, receiver in receivers.items():
            try:
                receiver.start()
            except ListenError as error:
                findings.append(_cannot_listen(error))
            else:
                opened.callback(receiver.stop)
                addresses[what] = receiver.address
                findings.append(Finding("ok", f"listening for {options.seconds:g} s on {receiver.address}"))
        others = set() if options.host in ("0.0.0.0", "::") else elsewhere.own_addresses() - {options.host}
        beside = elsewhere.OtherInterfaces(sorted(others), options.osc_port, options.input_port)
        listen(options.seconds)
        findings += _elsewhere(options.host, beside.heard())
        if motive is not None:
            findings += self_report.of_motive(motive.status())
    heard = Heard(listener.sources, telemetry.counts().get("frames_dropped", {}), listener.complaints)
    return findings + diagnose(heard, expected_parts(actors), addresses)


def _receivers(
    options: argparse.Namespace, listener: Listener, telemetry: Telemetry
) -> tuple[dict[str, Any], NatNetBodies | None]:
    """Everything that would receive bodies in the server, and the one of NatNet if it is asked for."""
    receivers: dict[str, Any] = {
        "bodies": ZmqBodies(listener, telemetry, options.host, options.input_port),
        "osc": OscBodies(listener, telemetry, options.host, options.osc_port),
    }
    if options.natnet is None:
        return receivers, None
    host, port = parse_endpoint(options.natnet, COMMAND_PORT)
    motive = NatNetBodies(listener, telemetry, host, port, multicast=options.multicast, interface=options.interface)
    return {**receivers, "natnet": motive}, motive


def listen(seconds: float) -> None:
    """Let the receivers work."""
    threading.Event().wait(seconds)


def expected_parts(actors: Sequence[ActorConfig]) -> dict[str, BodyKey]:
    """Which body each wrist and prop of the actors is."""
    parts: dict[str, BodyKey] = {}
    for actor in actors:
        prefix = f"{actor.name}: " if len(actors) > 1 else ""
        parts |= {prefix + wrist: actor.wrists[wrist].key for wrist in WRISTS if wrist in actor.wrists}
        parts |= {prefix + thing.name: thing.body.key for thing in actor.objects}
    return parts


def ask_status(host: str, port: int, key: Path | None = None) -> dict[str, Any] | None:
    """The `status` of the server that runs there, or None if none answers. Raises `KeyFileError`."""
    address = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    try:
        answer = ControlClient(address, key, ANSWER_S).ask("status")
    except (OSError, RequestError):
        return None
    return answer if "counters" in answer else None


def _cannot_listen(error: ListenError) -> Finding:
    text = str(error)
    if os.strerror(errno.EADDRINUSE) in text:
        remedy = "see who has the port: `ss -lntup`, on Windows `netstat -ano`"
    elif os.strerror(errno.EADDRNOTAVAIL) in text:
        remedy = f"name an address of this machine: {', '.join(sorted(elsewhere.own_addresses()))}"
    else:
        remedy = "mend the address or the port"
    return Finding("problem", text, remedy)


def _elsewhere(host: str, heard: Mapping[str, int]) -> list[Finding]:
    return [
        Finding(
            "problem",
            f"{count} packets or connections came to {where}, but the server is to listen on {host}",
            f"send to {host}, or start the server with --host {where.rpartition(':')[0]} (and --keys and --allow)",
        )
        for where, count in heard.items()
    ]


if __name__ == "__main__":
    sys.exit(main())
