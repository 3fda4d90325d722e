"""Findings about frames, bodies and connections that were refused."""

from collections.abc import Iterator
from typing import Final

from manipnet.runtime.diagnosis.finding import RECENT_S, Finding, Report, ago

FEW: Final = 0.02
"""A smaller share of the frames than this is what any network loses."""
HARMLESS: Final = ("duplicate", "late", "time_jump", "other_sender", "jump", "zeros")
"""Reasons that are normal at times: when a sender restarts, or when a datagram arrives twice."""

BACKLOG: Final = "backlog"
"""What was sent while the server was not running and arrived when it had started; that is over at once."""

_REMEDIES: Final = {
    "oversized": "send one frame per message, with at most 64 KiB and 256 bodies",
    "unsupported": "update Motive, or this program",
    "not_allowed": "add the sender's address with --allow",
    "kernel": "there is too much traffic for this machine: stop what floods the port, or raise net.core.rmem_max",
    "incomplete": "the network loses packets: use a cable, or send each frame as one bundle with its time in it",
    "rate": "something floods the port with messages that cannot be used: find it and stop it",
    "duplicate": "the times of the frames do not advance: send the time of each capture, or leave the time out",
    "late": "the frames arrive more than half a second after others: use a cable, and one sender for each clock",
    "time_jump": "the times of the frames jump: send the time of each capture in seconds of one clock that rises",
    "other_sender": "two programs send the same bodies: stop all senders of a body but one",
    "unknown_body": "name the bodies that arrive in the rig file, or rename them in the tracking software",
    "mailbox_full": "this machine is too slow for what arrives: send fewer frames per second, or close other programs",
    "internal": "this is a fault of the program: see its log",
    "nan": "the sender writes numbers that are no numbers: mark a lost body as not tracked instead",
    "bounds": "a position is more than 1000 m away: send metres, not millimetres",
    "zero_quaternion": "the sender writes a rotation of zeros: mark a lost body as not tracked instead",
    "conflict": "two bodies have the same id or name: give each its own in the tracking software",
    "frozen": "a body is said to be tracked but does not change at all: its tracker has lost it",
    "jump": "a body moves faster than a hand can: check the units, and that no two bodies share a name",
    "swap": "the tracker confuses two bodies: make their markers more different",
    "zeros": "the sender writes zeros for a lost body: mark it as not tracked instead",
}
_COUNTERS: Final = {"frames_dropped": "frames or messages are dropped", "bodies_rejected": "bodies are rejected"}
_OTHER: Final = "see docs/protocol-in.md for what a message may contain"
_REFUSED: Final = {
    "handshake": (
        "they do not speak ZMTP 3, have the wrong keys, or are no PUB sockets",
        "connect a ZeroMQ PUB socket, with a key file if the server has --keys",
    ),
    "socket_type": (
        "their sockets have the wrong type, for example PUSH",
        "send bodies from a PUB socket, and receive hands with a SUB socket",
    ),
    "not_listed": (
        "their keys are not in clients.allow",
        "run `manipnet keys make NAME`, and give it that file",
    ),
    "too_many": ("there are too many connections", "close what connects again and again"),
    "endless": ("they send frames without end, but no message", "send each message as one frame"),
}


def of_drops(report: Report) -> Iterator[Finding]:
    """What was dropped or rejected, by reason, with how often and how long ago."""
    frames_hz = sum(sender["rate_hz"] for sender in report.get("senders", {}).values())
    actors = report.get("actors", {}).values()
    has_live_bodies = any(body["state"] == "live" for actor in actors for body in actor.get("bodies", {}).values())
    for counter, what in _COUNTERS.items():
        for reason, drop in report.get("drops", {}).get(counter, {}).items():
            line = report.get("log", {}).get(reason, "")
            text = f"{what} as {reason}: {drop['count']} so far, {drop['rate_hz']:.0f} per second, the newest "
            text += ago(drop["age_s"]) + (f"; {line}" if line else "")
            if reason == BACKLOG:
                text += "; they were sent before the server listened, and do not say when they were captured"
            is_normal = reason in HARMLESS and (drop["rate_hz"] <= FEW * frames_hz or drop["count"] < 10)
            # Some senders send each body in a frame of its own, and other bodies than those of the rig.
            is_normal = is_normal or (reason == "unknown_body" and has_live_bodies) or reason == BACKLOG
            if drop["age_s"] > RECENT_S or is_normal:
                yield Finding("note", text)
            else:
                yield Finding("problem", text, _REMEDIES.get(reason, _OTHER))


def of_refused(report: Report) -> Iterator[Finding]:
    """Connections that were refused."""
    for reason, drop in report.get("drops", {}).get("connections_refused", {}).items():
        why, remedy = _REFUSED[reason]
        text = f"{drop['count']} connections were refused, because {why}; the newest {ago(drop['age_s'])}"
        yield Finding("note", text) if drop["age_s"] > RECENT_S else Finding("problem", text, remedy)
