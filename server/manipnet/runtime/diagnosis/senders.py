"""Findings about each sender: its rate, its clock, its bodies, and what it sends that is not understood."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

from manipnet.runtime.diagnosis.finding import Finding, Report, ago, label, listed

RATES_HZ: Final = (30.0, 360.0)
SILENT_S: Final = 2.0
CLOCK_SPEEDS: Final = (0.2, 5.0)
"""Seconds of the sender's clock per second of this machine's. A replay may be slower or faster; a wrong unit makes a
factor of a thousand."""


def of_senders(report: Report) -> Iterator[Finding]:
    """What each sender sends, and what is wrong with it."""
    clocks = {**(report.get("osc") or {}).get("senders", {}), **(report.get("bodies") or {}).get("senders", {})}
    for source, sender in report.get("senders", {}).items():
        yield from _of_sender(source, sender, clocks.get(source, {}), (report.get("natnet") or {}).get("clock"))
    for source, about in clocks.items():
        for body, missing in about.get("halves", {}).items():
            text = f"{source}: body {body} is not used, because its {missing} never arrives"
            yield Finding("problem", text, f"let the sender send the {missing} too")
        for body in about.get("conflicts", ()):
            text = f"{source}: two bodies have the key {body}, so neither is used"
            yield Finding("problem", text, "give each its own id or name in the tracking software")
    yield from _of_ignored(report)


def _of_sender(
    source: str, sender: Mapping[str, Any], about: Mapping[str, Any], motive_clock: Mapping[str, Any] | None
) -> Iterator[Finding]:
    rate_hz, age_s, speed = sender["rate_hz"], sender["age_s"], sender["clock_speed"]
    bodies = listed([label(body) for body in sender["bodies"]]) or "none"
    if age_s > SILENT_S:
        text = f"{source} has stopped: the newest of its {sender['frames']} frames came {ago(age_s)}, with {bodies}"
        yield Finding("problem", text, "is it still running, and is its network cable plugged in?")
        return
    text = f"{source}: {sender['frames']} frames, {rate_hz:.0f} per second, the newest {ago(age_s)}"
    yield Finding("ok", f"{text}, with the bodies {bodies}")
    if rate_hz and not RATES_HZ[0] * 0.9 <= rate_hz <= RATES_HZ[1] * 1.1:
        remedy = f"send {RATES_HZ[0]:.0f} to {RATES_HZ[1]:.0f} frames per second"
        yield Finding("problem", f"{source} sends {rate_hz:.0f} frames per second", remedy)
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


def _of_ignored(report: Report) -> Iterator[Finding]:
    working = {source for source, sender in report.get("senders", {}).items() if sender["age_s"] <= SILENT_S}
    for address, ignored in (report.get("osc") or {}).get("not_understood", {}).items():
        text = (
            f"{ignored['source']} sends {address} {ignored['rate_hz']:.0f} times a second ({ignored['count']} so far, "
            f"the newest {ago(ignored['age_s'])}), which is not understood"
        )
        if ignored["source"] in working:
            yield Finding("note", text)
        else:
            remedy = "send one of the addresses in docs/protocol-in.md, or declare this one in the rig file"
            yield Finding("problem", text, f"{remedy}: [[server.osc_address]]")
