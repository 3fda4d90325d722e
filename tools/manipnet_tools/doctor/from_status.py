"""Turns the status of a running server, or of its NatNet client, into findings and remedies. Does no I/O."""

from collections.abc import Mapping
from typing import Any

from manipnet_tools.doctor.diagnosis import Finding, Traffic, diagnose, drops


def of_server(status: Mapping[str, Any], where: str) -> list[Finding]:
    """Findings from the answer to the request `status` of the server at `where`."""
    counters = status["counters"]
    received, dropped = counters.get("frames_in", {}), counters.get("frames_dropped", {})
    findings = [Finding("ok", f"a server runs here (control {where}); it reports:"), *of_receivers(status)]
    traffic = Traffic({}, dropped, ())
    if not received:
        return [*findings, *diagnose(traffic, {}, (f"the server at {where}",))]
    arrived = ", ".join(f"{count} by {source}" for source, count in received.items())
    findings += [Finding("ok", f"frames that arrived: {arrived}"), *drops(traffic)]
    if dropped.get("unknown_body"):
        findings.append(
            Finding(
                "problem",
                f"{dropped['unknown_body']} frames contain no body that the rig knows",
                "stop the server and run `manipnet doctor --rig FILE` to see which bodies arrive",
            )
        )
    for actor, reported in status.get("actors", {}).items():
        for body, health in reported.get("bodies", {}).items():
            findings += _body(f"{actor}: {body}", health)
    return findings


def of_receivers(statuses: Mapping[str, Any]) -> list[Finding]:
    """Findings from the statuses of receivers, by the receiver's name in the request `status`."""
    return of_motive(statuses["natnet"]) if statuses.get("natnet") is not None else []


def of_motive(status: Mapping[str, Any]) -> list[Finding]:
    """Findings from the status of a NatNet client."""
    findings = []
    if status["server"] is not None:
        bodies = ", ".join(f"{id} {name!r}" for id, name in status["bodies"].items()) or "none"
        findings.append(Finding("ok", f"{status['server']} answers; it defines the rigid bodies {bodies}"))
    if status["problem"] is not None:
        findings.append(Finding("problem", f"NatNet: {status['problem']}", "see docs/natnet.md"))
    elif status["state"] == "connecting":
        findings.append(
            Finding(
                "problem",
                "Motive does not answer",
                "enable NatNet in Motive's streaming settings, set Local Interface to the network card that faces this "
                "machine, and let UDP ports 1510 and 1511 through both firewalls",
            )
        )
    elif status["state"] == "silent":
        remedy = "is Motive still running, and is its network cable plugged in?"
        findings.append(Finding("problem", "Motive answered before, but has stopped sending", remedy))
    elif status["state"] != "streaming":
        findings.append(
            Finding(
                "problem",
                "Motive answers but streams no frames",
                "choose Unicast as Transmission Type (or start with --multicast), and Live mode",
            )
        )
    return findings


def _body(part: str, health: Mapping[str, Any]) -> list[Finding]:
    if health.get("state") == "live":
        return []
    if health.get("age_s") is None:
        return [
            Finding(
                "problem",
                f"{part} has never been tracked since its stream began",
                "the rig names it differently from the stream, or it is switched off or occluded; stop the server and "
                "run `manipnet doctor --rig FILE` to see which bodies arrive",
            )
        ]
    remedy = "it is occluded or switched off, or its sender has stopped: check its state in the tracking software"
    return [Finding("problem", f"{part} is not tracked at present", remedy)]
