"""From what was heard for a few seconds to what is wrong and what to do: the reasoning of `manipnet doctor`, pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal

from manipnet.config.settings import BodyKey
from manipnet.wire.bodies import BodyFrame

RATES_HZ: Final = (30.0, 360.0)
CLOCK_RATIO: Final = (0.2, 5.0)
"""Seconds of stream time in one of ours: a replay may be slower or faster, a wrong unit is off by a thousand."""

Level = Literal["ok", "note", "problem"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One line for a person, and what to do about it when it is a problem."""

    level: Level
    text: str
    remedy: str = ""


@dataclass(slots=True)
class BodyHeard:
    """How often one body came, and how often tracked."""

    frames: int = 0
    tracked: int = 0


@dataclass(slots=True)
class SourceHeard:
    """What one sender sent."""

    frames: int = 0
    first: BodyFrame | None = None
    last: BodyFrame | None = None
    bodies: dict[tuple[int | None, str | None], BodyHeard] = field(default_factory=dict)

    def add(self, frame: BodyFrame) -> None:
        self.frames += 1
        self.first, self.last = self.first or frame, frame
        for body in frame.bodies:
            heard = self.bodies.setdefault((body.id, body.name), BodyHeard())
            heard.frames += 1
            heard.tracked += body.tracked

    def rate_hz(self) -> float:
        """Frames per second of our clock; zero with fewer than two."""
        if self.first is None or self.last is None or self.last.t_received_s <= self.first.t_received_s:
            return 0.0
        return (self.frames - 1) / (self.last.t_received_s - self.first.t_received_s)

    def clock_ratio(self) -> float:
        """Seconds of stream time in one of ours; one where it cannot be told."""
        if self.first is None or self.last is None or self.last.t_received_s - self.first.t_received_s < 0.5:
            return 1.0
        return (self.last.t_s - self.first.t_s) / (self.last.t_received_s - self.first.t_received_s)


@dataclass(frozen=True, slots=True)
class Heard:
    """Everything that was heard: by source, what was dropped by reason, and the last complaints of the readers."""

    sources: Mapping[str, SourceHeard]
    dropped: Mapping[str, int]
    complaints: Sequence[str]


def diagnose(heard: Heard, expected: Mapping[str, BodyKey], addresses: Mapping[str, str]) -> list[Finding]:
    """What the stream lacks for the parts `expected` (`{"left_wrist": key}`); `addresses` are what was listened on."""
    findings = drops(heard)
    if not heard.sources:
        listened = ", ".join(addresses.values()) or "no port"
        what = "packets arrive, but none that is understood" if heard.dropped else "nothing arrives at all"
        remedy = (
            "compare what the sender sends with docs/protocol-in.md"
            if heard.dropped
            else f"is the sender running and sending to {listened}? From another machine, this one must listen on an "
            "address the sender can reach (--host), and a firewall must let it through (UDP for OSC and NatNet)"
        )
        return [*findings, Finding("problem", what, remedy)]
    for source, sent in heard.sources.items():
        findings += _source(source, sent)
    return findings + _parts(heard, expected)


_DROP_REMEDIES: Final = {
    "malformed": "see docs/protocol-in.md for what a message may hold",
    "oversized": "send one frame a message, at most 64 KiB and 256 bodies",
    "unsupported": "update Motive, or this program",
    "not_allowed": "add the sender to the allow-list",
    "kernel": "too much traffic for this machine: stop what floods the port, or raise net.core.rmem_max",
    "incomplete": "the network loses packets: use a cable, send each frame as one bundle",
    "rate": "somebody floods the port with garbage: find and stop it",
}


def drops(heard: Heard) -> list[Finding]:
    """What was dropped, by reason, that somebody can do something about."""
    findings = []
    for reason, remedy in _DROP_REMEDIES.items():
        if count := heard.dropped.get(reason):
            said = next((text for text in reversed(heard.complaints) if f"({reason})" in text), "")
            findings.append(Finding("problem", f"{count} dropped as {reason}" + (f": {said}" if said else ""), remedy))
    return findings


def _source(source: str, sent: SourceHeard) -> list[Finding]:
    rate_hz, ratio = sent.rate_hz(), sent.clock_ratio()
    findings = [Finding("ok", f"{source}: {sent.frames} frames, {rate_hz:.0f} a second, {_list_bodies(sent)}")]
    if rate_hz and not RATES_HZ[0] * 0.9 <= rate_hz <= RATES_HZ[1] * 1.1:
        remedy = f"send {RATES_HZ[0]:.0f} to {RATES_HZ[1]:.0f} a second"
        findings.append(Finding("problem", f"{source}: {rate_hz:.0f} frames a second", remedy))
    if not CLOCK_RATIO[0] <= ratio <= CLOCK_RATIO[1]:
        findings.append(
            Finding(
                "problem",
                f"{source}: its clock makes {ratio:.3g} s in one second of ours",
                "ZeroMQ's t is in seconds, OSC's /frame/timestamp in milliseconds; neither may stand still",
            )
        )
    return findings


def _parts(heard: Heard, expected: Mapping[str, BodyKey]) -> list[Finding]:
    findings = []
    for part, key in expected.items():
        senders = {
            source: body
            for source, sent in heard.sources.items()
            for (id, name), body in sent.bodies.items()
            if str(key) in (str(id), str(name))
        }
        if not senders:
            arriving = sorted({_label(*key) for sent in heard.sources.values() for key in sent.bodies})
            remedy = (
                f"give it that name where it is tracked, or let the rig name one of: {', '.join(arriving) or 'none'}"
            )
            findings.append(Finding("problem", f"{part}: no body {key!r} arrives", remedy))
        elif len(senders) > 1:
            findings.append(
                Finding(
                    "problem",
                    f"{part}: body {key!r} comes from {len(senders)} senders: {', '.join(senders)}",
                    "stop all but one; only one of them is heard",
                )
            )
        else:
            findings.append(_tracking(part, key, next(iter(senders.values()))))
    return findings


def _tracking(part: str, key: BodyKey, body: BodyHeard) -> Finding:
    share = body.tracked / body.frames
    if not body.tracked:
        remedy = "occluded, out of the volume, or switched off: see its state in the tracking software"
        return Finding("problem", f"{part}: body {key!r} arrives but is never tracked", remedy)
    level: Level = "ok" if share > 0.9 else "note"
    return Finding(level, f"{part}: body {key!r} is tracked in {100 * share:.0f} % of {body.frames} frames")


def _list_bodies(sent: SourceHeard) -> str:
    names = [_label(*key) for key in sent.bodies]
    shown = ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
    return f"bodies {shown}"


def _label(id: int | None, name: str | None) -> str:
    if id is None:
        return repr(name)
    return str(id) if name is None else f"{id} {name!r}"
