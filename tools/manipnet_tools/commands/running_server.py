"""Reaches the server that `--server` names, and the other sockets of which its answer to `hello` tells."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from manipnet.common.options import ConfigError, Endpoint, parse_endpoint
from manipnet.config.settings import control_endpoint
from manipnet.control.client import ControlClient
from manipnet.runtime.run_file import running_servers

SLOW_S: Final = 1.0
"""A server that has not answered for this long is reported to the user."""
GIVE_UP_S: Final = 3.0
EVERYWHERE: Final = ("0.0.0.0", "::")


def reach(server: str, keys: Path | None, say: Callable[[str], None]) -> tuple[ControlClient, dict[str, Any]]:
    """A client of the server, and the server's answer to `hello`.

    Calls `say` after `SLOW_S` without an answer. Raises `ConfigError` after `GIVE_UP_S`, and `KeyFileError`.
    """
    begin_s = time.monotonic()
    for timeout_s in (SLOW_S, GIVE_UP_S - SLOW_S):
        client = ControlClient(server, keys, timeout_s)
        try:
            return ControlClient(server, keys), client.ask("hello")
        except TimeoutError:
            if timeout_s == SLOW_S:
                say(f"no server answers at {client.address} yet")
        except ConnectionError as error:
            raise ConfigError(str(error)) from None
    raise ConfigError(no_answer(server, keys, time.monotonic() - begin_s))


def no_answer(server: str, keys: Path | None, waited_s: float) -> str:
    """Why a server may not answer, and which servers run on this machine."""
    found = running_servers()
    host, port = control_endpoint(server)
    text = f"no server answers at tcp://{host}:{port} within {waited_s:.0f} s"
    others = [f"{each.addresses['control']} (process {each.pid})" for each in found if "control" in each.addresses]
    here = f"; on this machine servers run at {', '.join(others)}" if others else ""
    if any(each.has_keys for each in found) and keys is None:
        return f"{text}{here}; a server that was started with --keys needs --keys FILE here too"
    remedy = "name one with --server HOST:PORT" if others else "start one with manipnet-serve, or name it with --server"
    return f"{text}{here}; {remedy}"


def address_of(what: str, hello: Mapping[str, Any], server: str) -> Endpoint:
    """Host and port of a socket by its name in the `ready` line, as reached from here. Raises `ConfigError`."""
    address = (hello.get("addresses") or {}).get(what)
    if address is None:
        raise ConfigError(f"the server at {server} does not say where its {what} are; update it to this version")
    host, port = parse_endpoint(str(address).partition("://")[2], 0)
    return (control_endpoint(server)[0] if host in EVERYWHERE else host), port
