"""Findings about Motive, from the status of the NatNet client."""

from collections.abc import Iterator, Mapping
from typing import Any

from manipnet.runtime.diagnosis.finding import Finding, listed


def of_motive(status: Mapping[str, Any]) -> Iterator[Finding]:
    """What Motive answers, defines and streams, and what is wrong with it."""
    if status["server"] is not None:
        bodies = listed([f"{id} {name!r}" for id, name in status["bodies"].items()]) or "none"
        bones = f", and the bones {listed(list(map(repr, status['bones'])))}" if status["bones"] else ""
        yield Finding("ok", f"{status['server']} answers; it defines the rigid bodies {bodies}{bones}")
    yield from _of_state(status)
    for conflict in status["conflicts"]:
        yield Finding("problem", f"NatNet: {conflict}", "every rigid body needs its own name and its own streaming id")
    unused = ", ".join(f"{count} {what}" for what, count in status["unused"].items())
    if unused:
        yield Finding("note", f"Motive also streams what is not used: {unused}")
    if status["state"] != "streaming" or status["bodies"]:
        return
    if "bones without a name" in status["unused"]:
        remedy = (
            "enable Skeletons in Motive's streaming settings, so that it sends the names too, and name bones like "
            "'Ann:LHand' in the rig; or create rigid bodies for wrists and props"
        )
        yield Finding("problem", "Motive streams skeletons whose bones have no names, and no rigid bodies", remedy)
    elif not status["bones"]:
        remedy = "create rigid bodies for wrists and props, and enable Rigid Bodies in Motive's streaming settings"
        yield Finding("problem", "Motive streams frames, but defines no rigid bodies and no skeletons", remedy)


def _of_state(status: Mapping[str, Any]) -> Iterator[Finding]:
    if status["problem"] is not None:
        yield Finding("problem", f"NatNet: {status['problem']}", "see docs/natnet.md")
    elif status["state"] == "connecting":
        yield Finding(
            "problem",
            "Motive does not answer",
            "enable NatNet in Motive's streaming settings, set Local Interface to the network card that faces this "
            "machine, and let UDP ports 1510 and 1511 through both firewalls",
        )
    elif status["state"] == "silent":
        remedy = "is Motive still running, and is its network cable plugged in?"
        yield Finding("problem", "Motive answered before, but has stopped sending", remedy)
    elif status["state"] != "streaming":
        yield Finding(
            "problem",
            "Motive answers but streams no frames",
            "choose Unicast as Transmission Type (or start with --multicast), and Live mode",
        )
