"""Findings about each wrist and prop of the rig: whether its body arrives, is tracked, and is used."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

from manipnet.runtime.diagnosis.finding import Finding, Report, ago, label, listed
from manipnet.runtime.diagnosis.senders import SILENT_S

_WHY: Final = ("time_jump", "late", "duplicate", "other_sender", "conflict", "frozen", "jump", "swap", "zeros", "nan")


def of_parts(report: Report) -> list[Finding]:
    """What arrives for each part of each actor, and what arrives for nobody."""
    actors = report.get("actors", {})
    findings: list[Finding] = []
    used: set[str] = set()
    for actor, about in actors.items():
        for role, health in about.get("bodies", {}).items():
            part = f"{actor}: {role}" if len(actors) > 1 else role
            used.add(str(health["body"]))
            findings.append(_of_part(part, health, report))
    return findings + list(_unused(report, used))


def _of_part(part: str, health: Mapping[str, Any], report: Report) -> Finding:
    key = health["body"]
    arriving = {source: body for source, body in _bodies(report) if str(key) in (str(body["id"]), str(body["name"]))}
    fresh = {source: body for source, body in arriving.items() if body["age_s"] <= SILENT_S}
    if not fresh:
        return _missing(part, key, arriving, report)
    if len(fresh) > 1:
        remedy = "stop all senders of this body but one; the server uses only one of them"
        return Finding("problem", f"{part}: body {key!r} comes from {len(fresh)} senders: {', '.join(fresh)}", remedy)
    ((source, body),) = fresh.items()
    share = body["tracked"]
    if not share:
        remedy = "it is occluded, outside of the volume or switched off: check its state in the tracking software"
        text = f"{part}: body {key!r} arrives but is never tracked ({body['rate_hz']:.0f} frames per second"
        return Finding("problem", f"{text} from {source}, the newest {ago(body['age_s'])})", remedy)
    text = (
        f"{part}: body {key!r} is tracked in {100 * share:.0f} % of {body['rate_hz']:.0f} frames per second from "
        f"{source}, the newest {ago(body['age_s'])}"
    )
    if health["state"] == "live":
        return Finding("ok" if share > 0.9 else "note", text)
    why = _why(report)
    remedy = (
        "see the other findings about what is dropped" if why else "this computer may be too busy: run manipnet bench"
    )
    return Finding("problem", f"{text}, but is not used{why}", remedy)


def _missing(part: str, key: object, arrived: Mapping[str, Mapping[str, Any]], report: Report) -> Finding:
    if arrived:
        source, body = min(arrived.items(), key=lambda item: item[1]["age_s"])
        remedy = "it is switched off or no longer streamed, or its sender has stopped"
        text = f"{part}: nothing of body {key!r} for {body['age_s']:.0f} s; the last came from {source}"
        return Finding("problem", text, remedy)
    if reason := _refused(key, report):
        return Finding("problem", f"{part}: body {key!r} is refused: {reason}", "rename it, or give it another id")
    others = sorted({label(body) for _, body in _fresh(report)})
    remedy = "give the body that name in the tracking software, or name one of these in the rig: " + listed(others)
    if not others:
        remedy = "see the other findings: no body arrives at all"
    return Finding("problem", f"{part}: no body {key!r} arrives", remedy)


def _unused(report: Report, used: set[str]) -> Iterator[Finding]:
    others = [label(body) for _, body in _fresh(report) if not used & {str(body["id"]), str(body["name"])}]
    if others and used:
        yield Finding("note", f"these bodies arrive but are not in the rig: {listed(sorted(set(others)))}")


def _bodies(report: Report) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for source, sender in report.get("senders", {}).items():
        for body in sender["bodies"]:
            yield source, body


def _fresh(report: Report) -> Iterator[tuple[str, Mapping[str, Any]]]:
    return ((source, body) for source, body in _bodies(report) if body["age_s"] <= SILENT_S)


def _refused(key: object, report: Report) -> str:
    """Why Motive's definitions do not tell which body is meant, if they do not."""
    conflicts = (report.get("natnet") or {}).get("conflicts", ())
    return next((text for text in conflicts if repr(key) in text or f"id {key} " in text), "")


def _why(report: Report) -> str:
    drops = report.get("drops", {})
    recent = {
        reason: drop["rate_hz"]
        for counter in ("frames_dropped", "bodies_rejected")
        for reason, drop in drops.get(counter, {}).items()
        if reason in _WHY and drop["age_s"] <= SILENT_S
    }
    return f" (most is lost as {max(recent, key=lambda reason: recent[reason])})" if recent else ""
