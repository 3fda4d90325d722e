"""Examines the servers of this machine, or listens in their place."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from manipnet.config.settings import ServerConfig
from manipnet.control.client import ControlClient
from manipnet.control.request import RequestError
from manipnet.runtime.diagnosis.finding import Finding, of_map
from manipnet.runtime.run_file import RunningServer, running_servers
from manipnet_tools.doctor.listening import listen_and_diagnose

ANSWER_S = 2.0


def examine(config: ServerConfig, port_given: bool, key: Path | None, listen_s: float) -> list[Finding]:
    """Ask the servers that run here, or listen in their place. Raises `ConfigError` and `KeyFileError`.

    If the control port was given, the server there is meant; any other is only mentioned. Without a server it listens
    for `listen_s` seconds.
    """
    status = ask_status(_address(config.host, config.control_port), key)
    if status is not None:
        return of_server(status, f"{config.host}:{config.control_port}")
    others = [server for server in running_servers() if server.addresses.get("control")]
    if others and not port_given:
        return [finding for server in others for finding in _of_running(server, key)]
    mentioned = [
        Finding(
            "note", f"another server runs here (process {each.pid}), with its control at {each.addresses['control']}"
        )
        for each in others
    ]
    return [*mentioned, *listen_and_diagnose(config, listen_s)]


def of_server(status: Mapping[str, Any], where: str) -> list[Finding]:
    """The server's own findings, from its answer to the request `status`."""
    begin = Finding("ok", f"a server runs here (control {where}); it reports:")
    arrived = ", ".join(f"{count} by {name}" for name, count in status["counters"].get("frames_in", {}).items())
    counted = [Finding("ok", f"frames that arrived: {arrived}")] if arrived else []
    return [begin, *counted, *map(of_map, status.get("doctor", ()))]


def ask_status(address: str, key: Path | None = None) -> dict[str, Any] | None:
    """The `status` of the server at that control address, or None if none answers. Raises `KeyFileError`."""
    try:
        answer = ControlClient(address, key, ANSWER_S).ask("status")
    except (OSError, RequestError):
        return None
    return answer if "counters" in answer else None


def _of_running(server: RunningServer, key: Path | None) -> list[Finding]:
    """The findings of a server that has announced itself."""
    control = server.addresses["control"].removeprefix("tcp://")
    status = ask_status(control.replace("0.0.0.0", "127.0.0.1"), key)
    if status is not None:
        return of_server(status, control)
    text = f"a server runs here (process {server.pid}, control {control}), but does not answer"
    if server.has_keys:
        return [Finding("problem", f"{text} to strangers, since it was started with --keys", "give --key NAME.toml")]
    return [Finding("problem", text, "it is starting, busy or stuck: see its terminal and its log")]


def _address(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
