"""`manipnet doctor`: why nothing arrives. Listens where the server would, or asks the server that already does."""

import argparse
import json
import logging
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import zmq

from manipnet.config import WRISTS, ActorConfig, BodyKey, ConfigError, ServerConfig, default_actor, parse_endpoint
from manipnet.diagnosis import Finding, Heard, SourceHeard, diagnose
from manipnet.rig import load_rig
from manipnet.streams.bodies import BodyFrame
from manipnet.streams.intake import ListenError
from manipnet.streams.natnet import COMMAND_PORT
from manipnet.streams.natnet_client import NatNetBodies
from manipnet.streams.osc import OscBodies
from manipnet.streams.zmq_bodies import ZmqBodies
from manipnet.telemetry import Counters

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
    parser.add_argument("--seconds", type=float, default=5.0, help="how long to listen (%(default)s)")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Print what was found; the exit status: 0 when all is well, 1 when something is not."""
    options = build_parser().parse_args(argv)
    try:
        findings = examine(options)
    except ConfigError as error:
        findings = [Finding("problem", str(error), "mend the rig file or the option")]
    for finding in findings:
        print(f"{finding.level:8}{finding.text}")
        if finding.remedy:
            print(f"{'':8}→ {finding.remedy}")
    return int(any(finding.level == "problem" for finding in findings))


def examine(options: argparse.Namespace) -> list[Finding]:
    """Listen or ask, and reason about it; raises `ConfigError` for a wrong rig file or option."""
    actors = load_rig(options.rig).actors if options.rig is not None else (default_actor(),)
    running = ask_status(options.host, options.control_port)
    if running is not None:
        return _running(running, options)
    listener, counters = Listener(), Counters()
    log = logging.getLogger("manipnet.streams")
    findings: list[Finding] = []
    addresses: dict[str, str] = {}
    motive: NatNetBodies | None = None
    with ExitStack() as opened:
        log.addHandler(listener)
        opened.callback(log.removeHandler, listener)
        receivers: dict[str, Any] = {
            "bodies": ZmqBodies(listener, counters, options.host, options.input_port),
            "osc": OscBodies(listener, counters, options.host, options.osc_port),
        }
        if options.natnet is not None:
            host, port = parse_endpoint(options.natnet, COMMAND_PORT)
            motive = NatNetBodies(
                listener, counters, host, port, multicast=options.multicast, interface=options.interface
            )
            receivers["natnet"] = motive
        for what, receiver in receivers.items():
            try:
                receiver.start()
            except ListenError as error:
                remedy = "see who has the port: `ss -lntup`, on Windows `netstat -ano`"
                findings.append(Finding("problem", str(error), remedy))
            else:
                opened.callback(receiver.stop)
                addresses[what] = receiver.address
                findings.append(Finding("ok", f"listening for {options.seconds:g} s on {receiver.address}"))
        threading.Event().wait(options.seconds)
        if motive is not None:
            findings += _motive(motive.status())
    heard = Heard(listener.sources, counters.snapshot().get("frames_dropped", {}), listener.complaints)
    return findings + diagnose(heard, expected_parts(actors), addresses)


def expected_parts(actors: Sequence[ActorConfig]) -> dict[str, BodyKey]:
    """Which body each wrist and prop of the actors is."""
    parts: dict[str, BodyKey] = {}
    for actor in actors:
        prefix = f"{actor.name}: " if len(actors) > 1 else ""
        parts |= {prefix + wrist: actor.wrists[wrist].key for wrist in WRISTS if wrist in actor.wrists}
        parts |= {prefix + thing.name: thing.body.key for thing in actor.objects}
    return parts


def ask_status(host: str, port: int) -> dict[str, Any] | None:
    """The `status` of the server that runs there; None when none answers."""
    with zmq.Context() as context, context.socket(zmq.REQ) as request:
        request.setsockopt(zmq.LINGER, 0)
        request.connect(f"tcp://{host}:{port}")
        request.send(b'{"op": "status"}')
        if not request.poll(int(1e3 * ANSWER_S)):
            return None
        try:
            answer = json.loads(request.recv())
        except ValueError:
            return None
    return answer if isinstance(answer, dict) and "counters" in answer else None


def _running(status: Mapping[str, Any], options: argparse.Namespace) -> list[Finding]:
    """What a running server says of itself."""
    where = f"{options.host}:{options.control_port}"
    findings = [Finding("ok", f"a server runs here (control {where}); this is what it says")]
    counters = status["counters"]
    received = counters.get("frames_in", {})
    dropped = counters.get("frames_dropped", {})
    if not received:
        findings += diagnose(Heard({}, dropped, ()), {}, {"server": f"the server at {options.host}"})
    else:
        arrived = ", ".join(f"{count} by {source}" for source, count in received.items())
        findings.append(Finding("ok", f"frames that arrived: {arrived}"))
    if dropped.get("unknown_body"):
        findings.append(
            Finding(
                "problem",
                f"{dropped['unknown_body']} frames hold no body the rig knows",
                "stop the server and run `manipnet doctor --rig FILE` to see which bodies arrive",
            )
        )
    for actor, said in status.get("actors", {}).items():
        for body, health in said.get("bodies", {}).items():
            if health.get("state") != "live":
                remedy = "occluded, switched off, or its sender stopped: see the tracking software"
                findings.append(Finding("problem", f"{actor}: {body} is not tracked at present", remedy))
    return findings


def _motive(status: Mapping[str, Any]) -> list[Finding]:
    """What the NatNet client found out."""
    findings = []
    if status["server"] is not None:
        bodies = ", ".join(f"{id} {name!r}" for id, name in status["bodies"].items()) or "none"
        findings.append(Finding("ok", f"{status['server']} answers; rigid bodies it defines: {bodies}"))
    if status["problem"] is not None:
        findings.append(Finding("problem", f"NatNet: {status['problem']}", "see docs/natnet.md"))
    elif status["state"] == "connecting":
        findings.append(
            Finding(
                "problem",
                "Motive does not answer",
                "enable NatNet in Motive's streaming settings, set Local Interface to the card that faces this "
                "machine, allow UDP 1510 and 1511 through the firewalls",
            )
        )
    elif status["state"] != "streaming":
        findings.append(
            Finding(
                "problem",
                "Motive answers but streams no frames",
                "choose Unicast as Transmission Type (or start with --multicast), and Live mode",
            )
        )
    return findings


if __name__ == "__main__":
    sys.exit(main())
