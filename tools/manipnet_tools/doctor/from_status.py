"""From what a running server, or its NatNet client, says of itself to what is wrong and what to do. Pure."""

from collections.abc import Mapping
from typing import Any

from manipnet_tools.doctor.diagnosis import Finding, Heard, diagnose, drops


def of_server(status: Mapping[str, Any], where: str) -> list[Finding]:
    """Findings from the answer to `status` of the server at `where`."""
    counters = status["counters"]
    received, dropped = counters.get("frames_in", {}), counters.get("frames_dropped", {})
    findings = [Finding("ok", f"a server runs here (control {where}); this is what it says")]
    if "natnet" in status:
        findings += of_motive(status["natnet"])
    heard = Heard({}, dropped, ())
    if not received:
        return [*findings, *diagnose(heard, {}, {"server": f"the server at {where}"})]
    arrived = ", ".join(f"{count} by {source}" for source, count in received.items())
    findings += [Finding("ok", f"frames that arrived: {arrived}"), *drops(heard)]
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
            findings += _body(f"{actor}: {body}", health)
    return findings


def of_motive(status: Mapping[str, Any]) -> list[Finding]:
    """Findings from the status of a NatNet client."""
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
    elif status["state"] == "silent":
        findings.append(Finding("problem", "Motive has fallen silent", "is it still running, its cable plugged in?"))
    elif status["state"] != "streaming":
        findings.append(
            Finding(
                "problem",
                "Motive answers but streams no frames",
                "choose Unicast as Transmission Type (or start with --multicast), and Live mode",
            )
        )
    return findings


def _body(which: str, health: Mapping[str, Any]) -> list[Finding]:
    if health.get("state") == "live":
        return []
    if health.get("age_s") is None:
        return [
            Finding(
                "problem",
                f"{which} has never been tracked since its stream began",
                "its name or id in the rig is another than in the stream, or it is switched off or occluded: "
                "`manipnet doctor --rig FILE` without the server tells which",
            )
        ]
    remedy = "occluded, switched off, or its sender stopped: see the tracking software"
    return [Finding("problem", f"{which} is not tracked at present", remedy)]
