"""Listens where a server would listen, and diagnoses what arrives as the server would."""

import errno
import logging
import os
import time
from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

from manipnet.config.settings import ServerConfig
from manipnet.control.peers import Peers
from manipnet.inputs import make_receivers
from manipnet.inputs.declaration import Input, Receiver
from manipnet.inputs.sender_stats import SenderStats
from manipnet.net.errors import ListenError
from manipnet.runtime.diagnosis.diagnose import diagnose
from manipnet.runtime.diagnosis.finding import Finding
from manipnet.telemetry import Telemetry
from manipnet_tools.doctor import other_interfaces
from manipnet_tools.doctor.rehearsal import Rehearsal


class DropLog(logging.Handler):
    """Keeps the newest log line of the receivers for each reason of a drop."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: dict[str, str] = {}

    def emit(self, record: logging.LogRecord) -> None:
        """Take one log line."""
        text = record.getMessage()
        if "dropped (" in text:
            self.lines[text.partition("dropped (")[2].partition(")")[0]] = text


def listen_and_diagnose(config: ServerConfig, seconds: float) -> list[Finding]:
    """Start the server's receivers for some seconds, and diagnose what arrives."""
    telemetry, drop_log = Telemetry(), DropLog()
    rehearsal = Rehearsal(config.actors, telemetry)
    peers = Peers(SenderStats(rehearsal.put))
    log = logging.getLogger("manipnet.inputs")
    findings: list[Finding] = []
    made = make_receivers(config.of, peers.senders, telemetry, config.host, None, config.allow, config.body_keys)
    with ExitStack() as opened:
        log.addHandler(drop_log)
        opened.callback(log.removeHandler, drop_log)
        peers.receivers = {declared.title: each for declared, each in made.items() if _starts(each, opened, findings)}
        for receiver in peers.receivers.values():
            findings.append(Finding("ok", f"listening for {seconds:g} s on {receiver.address}"))
        beside = _other_interfaces(config, made)
        listen(seconds, rehearsal)
        findings += _wrong_addresses(config.host, beside.counts())
        report = _report(peers, rehearsal, telemetry, drop_log)
    return findings + diagnose(report)


def listen(seconds: float, rehearsal: Rehearsal) -> None:
    """Take in what arrives, for some seconds."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        rehearsal.work()


def _starts(receiver: Receiver, opened: ExitStack, findings: list[Finding]) -> bool:
    try:
        receiver.start()
    except ListenError as error:
        findings.append(_cannot_listen(error))
        return False
    opened.callback(receiver.stop)
    return True


def _report(peers: Peers, rehearsal: Rehearsal, telemetry: Telemetry, drop_log: DropLog) -> dict[str, Any]:
    """What a server's `status` would say about its reception."""
    return {
        **peers.report(),
        "actors": rehearsal.report(time.monotonic()),
        "counters": telemetry.counts(),
        "drops": telemetry.losses(),
        "receivers": telemetry.receivers(),
        "log": drop_log.lines,
    }


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
