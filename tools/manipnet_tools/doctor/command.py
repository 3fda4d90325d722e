"""`manipnet doctor`: says why no bodies arrive. It asks the running server, or else listens in its place."""

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

from manipnet.common.options import ConfigError, Option
from manipnet.config.flags import add_flags, read_flags
from manipnet.config.rig_reader import Rig, load_rig
from manipnet.config.settings import (
    WRISTS,
    ActorConfig,
    BodyKey,
    ServerConfig,
    all_options,
    default_actor,
    input_options,
    server_config,
)
from manipnet.control.request import RequestError
from manipnet.inputs import make_receivers
from manipnet.inputs.declaration import Input
from manipnet.net.curve_keys import KeyFileError
from manipnet.net.errors import ListenError
from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import BodyFrame
from manipnet_tools.doctor import other_interfaces
from manipnet_tools.doctor.diagnosis import Finding, SourceTraffic, Traffic, diagnose
from manipnet_tools.doctor.from_status import of_receivers, of_server

ANSWER_S = 2.0
MAX_SOURCES = 32
MAX_LOG_LINES = 20


class TrafficMonitor(logging.Handler):
    """Collects frames, as a sink, and the receivers' log lines, as a log handler. From any thread."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._lock = threading.Lock()
        self.sources: dict[str, SourceTraffic] = {}
        self.log: list[str] = []

    def __call__(self, frame: BodyFrame) -> None:
        """Take one frame."""
        with self._lock:
            if frame.source in self.sources or len(self.sources) < MAX_SOURCES:
                self.sources.setdefault(frame.source, SourceTraffic()).add(frame)

    def emit(self, record: logging.LogRecord) -> None:
        """Take one log line."""
        self.log = [*self.log[1 - MAX_LOG_LINES :], record.getMessage()]


def build_parser() -> argparse.ArgumentParser:
    """The options of `manipnet doctor`; those of the server have the server's defaults."""
    parser = argparse.ArgumentParser(
        prog="manipnet doctor",
        usage="manipnet doctor [options]",
        description="Say why no tracked bodies arrive, and what to do. Asks the server that runs on this machine; "
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
    """Ask the server, or listen in its place, and diagnose. Raises `ConfigError` and `KeyFileError`."""
    rig = Rig((default_actor(),)) if options.rig is None else load_rig(options.rig)
    config = server_config(rig.actors, rig.server | read_flags(options, _server_options()))
    status = ask_status(config.host, config.control_port, options.key)
    if status is not None:
        return of_server(status, f"{config.host}:{config.control_port}")
    return listen_and_diagnose(config, options.seconds)


def listen_and_diagnose(config: ServerConfig, seconds: float) -> list[Finding]:
    """Start the server's receivers for some seconds, and diagnose what arrives."""
    monitor, telemetry = TrafficMonitor(), Telemetry()
    log = logging.getLogger("manipnet.inputs")
    findings: list[Finding] = []
    addresses: list[str] = []
    receivers = make_receivers(config.of, monitor, telemetry, config.host)
    with ExitStack() as opened:
        log.addHandler(monitor)
        opened.callback(log.removeHandler, monitor)
        for receiver in receivers.values():
            try:
                receiver.start()
            except ListenError as error:
                findings.append(_cannot_listen(error))
            else:
                opened.callback(receiver.stop)
                addresses.append(receiver.address)
                findings.append(Finding("ok", f"listening for {seconds:g} s on {receiver.address}"))
        beside = _other_interfaces(config, receivers)
        listen(seconds)
        findings += _wrong_addresses(config.host, beside.counts())
        findings += of_receivers({declared.title: receiver.status() for declared, receiver in receivers.items()})
    traffic = Traffic(monitor.sources, telemetry.counts().get("frames_dropped", {}), monitor.log)
    return findings + diagnose(traffic, expected_parts(config.actors), addresses)


def listen(seconds: float) -> None:
    """Let the receivers work."""
    threading.Event().wait(seconds)


def expected_parts(actors: Sequence[ActorConfig]) -> dict[str, BodyKey]:
    """The body of each wrist and prop of the actors."""
    parts: dict[str, BodyKey] = {}
    for actor in actors:
        prefix = f"{actor.name}: " if len(actors) > 1 else ""
        parts |= {prefix + wrist: actor.wrists[wrist].key for wrist in WRISTS if wrist in actor.wrists}
        parts |= {prefix + thing.name: thing.body.key for thing in actor.objects}
    return parts


def ask_status(host: str, port: int, key: Path | None = None) -> dict[str, Any] | None:
    """The `status` of the server that runs there, or None if none answers. Raises `KeyFileError`."""
    from manipnet.control.client import ControlClient  # loads ZeroMQ, for which a wrong option does not wait

    address = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    try:
        answer = ControlClient(address, key, ANSWER_S).ask("status")
    except (OSError, RequestError):
        return None
    return answer if "counters" in answer else None


def _server_options() -> list[Option]:
    options = all_options()
    return [options["host"], options["control_port"], *input_options()]


def _other_interfaces(config: ServerConfig, receivers: Mapping[Input, Any]) -> other_interfaces.OtherInterfaces:
    everywhere = config.host in ("0.0.0.0", "::")
    addresses = set() if everywhere else other_interfaces.own_addresses() - {config.host}
    ports: list[other_interfaces.Port] = [
        (declared.transport, getattr(config.of(declared.options), declared.where.field))
        for declared in receivers
        if declared.transport is not None
    ]
    return other_interfaces.OtherInterfaces(sorted(addresses), ports)


def _cannot_listen(error: ListenError) -> Finding:
    text = str(error)
    if os.strerror(errno.EADDRINUSE) in text:
        remedy = "see which program has the port: `ss -lntup`, on Windows `netstat -ano`"
    elif os.strerror(errno.EADDRNOTAVAIL) in text:
        remedy = f"name an address of this machine: {', '.join(sorted(other_interfaces.own_addresses()))}"
    else:
        remedy = "correct the address or the port"
    return Finding("problem", text, remedy)


def _wrong_addresses(host: str, counts: Mapping[str, int]) -> list[Finding]:
    return [
        Finding(
            "problem",
            f"{count} packets or connections came to {where}, but the server listens on {host}",
            f"send to {host}, or start the server with --host {where.rpartition(':')[0]} (and --keys and --allow)",
        )
        for where, count in counts.items()
    ]


if __name__ == "__main__":
    sys.exit(main())
