"""The whole diagnosis: sockets, senders, what was dropped or not understood, and each wrist and prop."""

from collections.abc import Iterator

from manipnet.runtime.diagnosis.drops import of_drops, of_refused
from manipnet.runtime.diagnosis.finding import Finding, Report
from manipnet.runtime.diagnosis.motive import of_motive
from manipnet.runtime.diagnosis.noise import of_noise
from manipnet.runtime.diagnosis.parts import of_parts
from manipnet.runtime.diagnosis.senders import of_senders


def diagnose(report: Report) -> list[Finding]:
    """What is right and wrong with the reception that `report` describes, the same for everybody who asks."""
    findings = [*_of_sockets(report)]
    if report.get("natnet") is not None:
        findings += of_motive(report["natnet"])
    findings += [*of_refused(report), *of_drops(report), *of_senders(report)]
    if not report.get("senders") and not any(finding.level == "problem" for finding in findings):
        findings.append(_nothing(report))
    return [*findings, *of_parts(report), *of_noise(report)]


def _of_sockets(report: Report) -> Iterator[Finding]:
    for name, receiver in report.get("receivers", {}).items():
        if receiver["state"] == "down":
            text = f"the socket {name} has failed ({receiver['error']}) and will be opened again"
            yield Finding("problem", text, "see which program or which change of the network took the address away")
    for address, is_connected in (report.get("bodies") or {}).get("trackers", {}).items():
        if is_connected:
            yield Finding("ok", f"the tracker at {address} is connected")
        else:
            remedy = "is it running, does it bind a PUB socket there, and do both firewalls let the port through?"
            yield Finding("problem", f"no tracker answers at {address} (--connect)", remedy)


def _nothing(report: Report) -> Finding:
    has_heard = sum(report.get("counters", {}).get("frames_in", {}).values()) or report.get("drops")
    osc = report.get("osc") or {}
    if has_heard or osc.get("not_understood") or osc.get("without_body") or osc.get("senders"):
        return Finding("problem", "nothing arrives any more", "is the sender still running?")
    addresses = ", ".join(report.get("listening", {}).values()) or "a port that is open here"
    return Finding(
        "problem",
        "nothing arrives at all",
        f"is the sender running, and does it send to {addresses}? If it runs on another machine, give --host an "
        "address that it can reach, and let it through the firewall (OSC and NatNet use UDP)",
    )
