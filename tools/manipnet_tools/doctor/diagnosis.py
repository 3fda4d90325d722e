"""Turns what arrived within a few seconds into findings and remedies, for `manipnet doctor`. Does no I/O."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal

from manipnet.config.settings import BodyKey
from manipnet.telemetry import DROP_REASONS
from manipnet.wire.bodies import BodyFrame

RATES_HZ: Final = (30.0, 360.0)
CLOCK_RATIO: Final = (0.2, 5.0)
"""Seconds of the sender's clock per second of this machine's. A replay may be slower or faster; a wrong unit makes a
factor of a thousand."""
MOST_NAMED: Final = 12

Level = Literal["ok", "note", "problem"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One line for a person. A problem has a remedy."""

    level: Level
    text: str
    remedy: str = ""


@dataclass(slots=True)
class BodyTraffic:
    """In how many frames one body arrived, and in how many of them it was tracked."""

    frames: int = 0
    tracked: int = 0


@dataclass(slots=True)
class SourceTraffic:
    """What arrived from one sender."""

    frames: int = 0
    first: BodyFrame | None = None
    last: BodyFrame | None = None
    bodies: dict[tuple[int | None, str | None], BodyTraffic] = field(default_factory=dict)

    def add(self, frame: BodyFrame) -> None:
        """Count one frame."""
        self.frames += 1
        self.first, self.last = self.first or frame, frame
        for body in frame.bodies:
            traffic = self.bodies.setdefault((body.id, body.name), BodyTraffic())
            traffic.frames += 1
            traffic.tracked += body.tracked

    def rate_hz(self) -> float:
        """Frames per second of this machine's clock; zero with fewer than two frames."""
        if self.first is None or self.last is None or self.last.t_received_s <= self.first.t_received_s:
            return 0.0
        return (self.frames - 1) / (self.last.t_received_s - self.first.t_received_s)

    def clock_ratio(self) -> float:
        """Seconds of the sender's clock per second of this machine's; one if too little has arrived to tell."""
        if self.first is None or self.last is None or self.last.t_received_s - self.first.t_received_s < 0.5:
            return 1.0
        return (self.last.t_s - self.first.t_s) / (self.last.t_received_s - self.first.t_received_s)


@dataclass(frozen=True, slots=True)
class Traffic:
    """What arrived, by sender; how much was dropped, by reason; and the newest log lines of the receivers."""

    sources: Mapping[str, SourceTraffic]
    dropped: Mapping[str, int]
    log: Sequence[str]


def diagnose(traffic: Traffic, expected: Mapping[str, BodyKey], addresses: Sequence[str]) -> list[Finding]:
    """What is wrong with the traffic, given the `expected` body of each part and the `addresses` of the receivers.

    `expected` is, for example, `{"left_wrist": 3}`.
    """
    findings = drops(traffic)
    if not traffic.sources:
        return [*findings, _nothing_usable(bool(traffic.dropped), addresses)]
    for source, sent in traffic.sources.items():
        findings += _source(source, sent)
    return findings + _parts(traffic, expected)


def _nothing_usable(dropped: bool, addresses: Sequence[str]) -> Finding:
    if dropped:
        remedy = "compare what the sender sends with docs/protocol-in.md"
        return Finding("problem", "packets arrive, but none of them can be used", remedy)
    return Finding(
        "problem",
        "nothing arrives at all",
        f"is the sender running, and does it send to {', '.join(addresses) or 'a port that is open here'}? If it runs "
        "on another machine, give --host an address that it can reach, and let it through the firewall (OSC and NatNet "
        "use UDP)",
    )


_OTHER_REMEDY: Final = "see docs/protocol-in.md for what a message may contain"
_DROP_REMEDIES: Final = {
    "oversized": "send one frame per message, with at most 64 KiB and 256 bodies",
    "unsupported": "update Motive, or this program",
    "not_allowed": "add the sender's address with --allow",
    "kernel": "there is too much traffic for this machine: stop what floods the port, or raise net.core.rmem_max",
    "incomplete": "the network loses packets: use a cable, or send each frame as one bundle",
    "rate": "something floods the port with messages that cannot be used: find it and stop it",
}


def drops(traffic: Traffic) -> list[Finding]:
    """What the receivers dropped, by reason. Frames that were dropped later, at the tick loop, are left out."""
    findings = []
    for reason, count in traffic.dropped.items():
        if reason not in DROP_REASONS:
            line = next((text for text in reversed(traffic.log) if f"({reason})" in text), "")
            text = f"{count} messages were dropped as {reason}" + (f": {line}" if line else "")
            findings.append(Finding("problem", text, _DROP_REMEDIES.get(reason, _OTHER_REMEDY)))
    return findings


def _source(source: str, sent: SourceTraffic) -> list[Finding]:
    rate_hz, ratio = sent.rate_hz(), sent.clock_ratio()
    findings = [
        Finding("ok", f"{source}: {sent.frames} frames, {rate_hz:.0f} per second, with the bodies {_bodies(sent)}")
    ]
    if rate_hz and not RATES_HZ[0] * 0.9 <= rate_hz <= RATES_HZ[1] * 1.1:
        remedy = f"send {RATES_HZ[0]:.0f} to {RATES_HZ[1]:.0f} frames per second"
        findings.append(Finding("problem", f"{source} sends {rate_hz:.0f} frames per second", remedy))
    if not CLOCK_RATIO[0] <= ratio <= CLOCK_RATIO[1]:
        findings.append(
            Finding(
                "problem",
                f"{source}: its time stamps advance by {ratio:.3g} s per second",
                "send t in seconds over ZeroMQ, and /frame/timestamp in milliseconds over OSC; they must keep rising",
            )
        )
    return findings


def _parts(traffic: Traffic, expected: Mapping[str, BodyKey]) -> list[Finding]:
    findings = []
    for part, key in expected.items():
        senders = {
            source: body
            for source, sent in traffic.sources.items()
            for (id, name), body in sent.bodies.items()
            if str(key) in (str(id), str(name))
        }
        if not senders:
            arriving = sorted({_label(*key) for sent in traffic.sources.values() for key in sent.bodies})
            remedy = (
                "give the body that name in the tracking software, or name one of these in the rig: "
                f"{', '.join(arriving) or 'none arrives'}"
            )
            findings.append(Finding("problem", f"{part}: no body {key!r} arrives", remedy))
        elif len(senders) > 1:
            findings.append(
                Finding(
                    "problem",
                    f"{part}: body {key!r} comes from {len(senders)} senders: {', '.join(senders)}",
                    "stop all senders of this body but one; the server uses only one of them",
                )
            )
        else:
            findings.append(_tracking(part, key, next(iter(senders.values()))))
    return findings


def _tracking(part: str, key: BodyKey, body: BodyTraffic) -> Finding:
    share = body.tracked / body.frames
    if not body.tracked:
        remedy = "it is occluded, outside of the volume or switched off: check its state in the tracking software"
        return Finding("problem", f"{part}: body {key!r} arrives but is never tracked", remedy)
    level: Level = "ok" if share > 0.9 else "note"
    return Finding(level, f"{part}: body {key!r} is tracked in {100 * share:.0f} % of {body.frames} frames")


def _bodies(sent: SourceTraffic) -> str:
    names = [_label(*key) for key in sent.bodies]
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more


def _label(id: int | None, name: str | None) -> str:
    if id is None:
        return repr(name)
    return str(id) if name is None else f"{id} {name!r}"
