"""Findings about each sender: its rate, its clock, its bodies, and what it sends that is not understood."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

from manipnet.runtime.diagnosis.finding import RECENT_S, Finding, Report, ago, label, listed

RATES_HZ: Final = (30.0, 360.0)
SILENT_S: Final = 2.0
FORGOTTEN_S: Final = 60.0
"""Beside a sender that works, one that stopped longer ago than this is history."""
CLOCK_SPEEDS: Final = (0.2, 5.0)
"""Seconds of the sender's clock per second of this machine's. A replay may be slower or faster; a wrong unit makes a
factor of a thousand."""


def of_senders(report: Report) -> Iterator[Finding]:
    """What each sender sends, and what is wrong with it."""
    osc = (report.get("osc") or {}).get("senders", {})
    about = {**osc, **(report.get("bodies") or {}).get("senders", {})}
    senders = report.get("senders", {})
    working = {source: sender for source, sender in senders.items() if sender["age_s"] <= SILENT_S}
    for source, sender in working.items():
        yield from _of_sender(source, sender, about.get(source, {}), (report.get("natnet") or {}).get("clock"))
    yield from _of_stopped({source: each for source, each in senders.items() if source not in working}, working)
    for source, each in osc.items():
        if each["age_s"] <= SILENT_S:
            yield from _of_osc_sender(source, each, source in senders)
    yield from _of_unused_addresses(report, working)


def _of_sender(
    source: str, sender: Mapping[str, Any], about: Mapping[str, Any], motive_clock: Mapping[str, Any] | None
) -> Iterator[Finding]:
    rate_hz, age_s, speed = sender["rate_hz"], sender["age_s"], sender["clock_speed"]
    bodies = [body for body in sender["bodies"] if body["age_s"] <= SILENT_S]
    text = f"{source}: {sender['frames']} frames, {rate_hz:.0f} per second, the newest {ago(age_s)}"
    yield Finding("ok", f"{text}, with the bodies {listed([label(body) for body in bodies]) or 'none'}")
    # A sender may spread the bodies of one instant over several frames.
    fastest_hz = max((body["rate_hz"] for body in bodies), default=rate_hz)
    if rate_hz and fastest_hz and not RATES_HZ[0] * 0.9 <= fastest_hz <= RATES_HZ[1] * 1.1:
        remedy = f"send {RATES_HZ[0]:.0f} to {RATES_HZ[1]:.0f} frames per second"
        yield Finding("problem", f"{source} sends {fastest_hz:.0f} frames per second", remedy)
    clock = about.get("clock") or (motive_clock if source.startswith("natnet:") else None)
    if clock is not None:
        yield from _of_clock(source, clock)
    if speed is not None and not CLOCK_SPEEDS[0] <= speed <= CLOCK_SPEEDS[1]:
        yield Finding(
            "problem",
            f"{source}: its time stamps advance by {speed:.3g} s per second",
            "send t in seconds over ZeroMQ, and /frame/timestamp in milliseconds over OSC; they must keep rising",
        )


def _of_clock(source: str, clock: Mapping[str, Any]) -> Iterator[Finding]:
    for name, fault in clock["set_aside"].items():
        if clock["used"] == "arrival":
            yield Finding(
                "problem",
                f"{source}: its {name} {fault}, so the times of arrival are used, which are less even",
                "send the time of each capture: t in seconds over ZeroMQ, /frame/timestamp in milliseconds over OSC",
            )
        else:
            yield Finding("note", f"{source}: its {name} {fault}, so {clock['used']} gives the times")


def _of_stopped(stopped: Mapping[str, Any], working: Mapping[str, Any]) -> Iterator[Finding]:
    """Senders that have stopped. It does not matter when others send their bodies now."""
    arriving = {label(body) for sender in working.values() for body in sender["bodies"] if body["age_s"] <= SILENT_S}
    replaced = [source for source, sender in stopped.items() if arriving >= {label(body) for body in sender["bodies"]}]
    if replaced:
        yield Finding("note", f"other senders now send the bodies of {listed(replaced, 4)}, which stopped before")
    for source, sender in stopped.items():
        if source in replaced:
            continue
        bodies = listed([label(body) for body in sender["bodies"]]) or "none"
        text = f"{source} has stopped: the newest of its {sender['frames']} frames came {ago(sender['age_s'])}"
        if working and sender["age_s"] > FORGOTTEN_S:
            yield Finding("note", f"{text}, with the bodies {bodies}")
        else:
            remedy = "is it still running, and is its network cable plugged in?"
            yield Finding("problem", f"{text}, with the bodies {bodies}", remedy)


def _of_osc_sender(source: str, about: Mapping[str, Any], sends_frames: bool) -> Iterator[Finding]:
    """What is wrong with the bodies of an OSC sender, which may not have sent a whole one."""
    for body, missing in about["halves"].items():
        text = f"{source}: body {body} is not used, because its {missing} never arrives"
        yield Finding("problem", text, f"let the sender send the {missing} too")
    for body in about["conflicts"]:
        text = f"{source}: two bodies have the key {body}, so neither is used"
        yield Finding("problem", text, "give each its own id or name in the tracking software")
    if not sends_frames and not about["halves"]:
        text = f"{source} sends messages that are understood, but no pose of a body"
        yield Finding("problem", text, "turn on rigid bodies, trackers or bones where the sender chooses what it sends")


def _of_unused_addresses(report: Report, working: Mapping[str, Any]) -> Iterator[Finding]:
    osc = report.get("osc") or {}
    for address, entry in osc.get("not_understood", {}).items():
        if entry["source"] in working or entry["age_s"] > RECENT_S:
            yield Finding("note", f"{_sent(address, entry)}, which is not understood")
        else:
            remedy = "send one of the addresses in docs/protocol-in.md, or declare this one in the rig file"
            text = f"{_sent(address, entry)}, which is not understood"
            yield Finding("problem", text, f"{remedy}: [[server.osc_address]]")
    useful = {source for source, about in osc.get("senders", {}).items() if about["age_s"] <= SILENT_S}
    for address, entry in osc.get("without_body", {}).items():
        if entry["source"] not in useful and entry["age_s"] <= RECENT_S:
            yield Finding(
                "problem",
                f"{_sent(address, entry)}, which is not about a tracked body",
                "let the sender send its trackers too: /VMC/Ext/Tra/Pos, /VMC/Ext/Con/Pos or /VMC/Ext/Hmd/Pos",
            )


def _sent(address: str, entry: Mapping[str, Any]) -> str:
    verb = "sends" if entry["age_s"] <= SILENT_S else "has sent"
    return (
        f"{entry['source']} {verb} {address} {entry['rate_hz']:.0f} times a second ({entry['count']} so far, "
        f"the newest {ago(entry['age_s'])})"
    )
