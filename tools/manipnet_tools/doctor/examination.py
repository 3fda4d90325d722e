"""Examines the servers of this machine, or listens in their place."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from manipnet.config.settings import CONTROL_PORT, ServerConfig, control_endpoint
from manipnet.control.client import ControlClient
from manipnet.control.request import RequestError
from manipnet.runtime.diagnosis.finding import Finding, ago, of_map
from manipnet.runtime.diagnosis.senders import SILENT_S
from manipnet.runtime.run_file import RunningServer, running_servers
from manipnet_tools.doctor.listening import listen_and_diagnose
from manipnet_tools.doctor.other_interfaces import own_addresses
from manipnet_tools.terminal import countdown

ANSWER_S = 2.0


def examine(config: ServerConfig, server: str | None, keys: Path | None, listen_s: float) -> list[Finding]:
    """Ask the servers that run here, or listen in their place. Raises `ConfigError` and `KeyFileError`.

    If a `server` is named, no other is asked; those that run here are only mentioned. Without an answer it listens for
    `listen_s` seconds, unless the server is on another machine.
    """
    where = server or f"{_bracketed(config.host)}:{CONTROL_PORT}"
    status = ask_status(where, keys)
    if status is not None:
        return of_server(status, where.removeprefix("tcp://"))
    others = [each for each in running_servers() if each.addresses.get("control")]
    if others and server is None:
        return [finding for each in others for finding in _of_running(each, keys)]
    findings = [_mentioned(each) for each in others]
    if server is not None:
        host, port = control_endpoint(server)
        text = f"no server answers at tcp://{_bracketed(host)}:{port}"
        if host not in own_addresses() | {config.host, "localhost", "::1"}:
            remedy = "is it running there, does its --host let this machine in, and does it require keys (--keys FILE)?"
            return [*findings, Finding("problem", text, remedy)]
        findings.append(Finding("note", f"{text}, so this command listens in its place"))
    with countdown("listening", listen_s):
        return [*findings, *listen_and_diagnose(config, listen_s)]


def of_server(status: Mapping[str, Any], where: str) -> list[Finding]:
    """The server's own findings, from its answer to the request `status`."""
    begin = Finding("ok", f"a server runs here (control {where}); it reports:")
    return [begin, *_arrived(status), *map(of_map, status.get("doctor", ()))]


def _arrived(status: Mapping[str, Any]) -> list[Finding]:
    """How many frames have arrived, and when the last one came."""
    arrived = ", ".join(f"{count} by {name}" for name, count in status["counters"].get("frames_in", {}).items())
    if not arrived:
        return []
    ages_s = {source: each["age_s"] for source, each in status.get("senders", {}).items()}
    if not ages_s:
        return [Finding("ok", f"frames that arrived: {arrived}")]
    source = min(ages_s, key=lambda each: ages_s[each])
    if ages_s[source] <= SILENT_S:
        return [Finding("ok", f"frames that arrived: {arrived}, the last {ago(ages_s[source])}")]
    text = f"nothing for {ages_s[source]:.0f} s; the last of the frames ({arrived}) came from {source}"
    return [Finding("note", text)]


def _mentioned(server: RunningServer) -> Finding:
    control = server.addresses["control"]
    return Finding("note", f"another server runs here (process {server.pid}), with its control at {control}")


def ask_status(address: str, keys: Path | None = None) -> dict[str, Any] | None:
    """The `status` of the server at that control address, or None if none answers. Raises `KeyFileError`."""
    try:
        answer = ControlClient(address, keys, ANSWER_S).ask("status")
    except (OSError, RequestError):
        return None
    return answer if "counters" in answer else None


def _of_running(server: RunningServer, keys: Path | None) -> list[Finding]:
    """The findings of a server that has announced itself."""
    control = server.addresses["control"].removeprefix("tcp://")
    status = ask_status(control.replace("0.0.0.0", "127.0.0.1"), keys)
    if status is not None:
        return of_server(status, control)
    text = f"a server runs here (process {server.pid}, control {control}), but does not answer"
    if server.has_keys:
        return [Finding("problem", f"{text} to strangers, since it was started with --keys", "give --keys NAME.toml")]
    return [Finding("problem", text, "it is starting, busy or stuck: see its terminal and its log")]


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host
