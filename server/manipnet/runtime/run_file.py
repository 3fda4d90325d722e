"""A small file for each running server, by which `manipnet doctor` finds it: its process and its addresses."""

import contextlib
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from platformdirs import user_state_path

MAX_BYTES: Final = 16_384


@dataclass(frozen=True, slots=True)
class RunningServer:
    """A server on this machine: its process, the addresses of its sockets, and whether it asks for keys."""

    pid: int
    addresses: Mapping[str, str]
    has_keys: bool


def announce(addresses: Mapping[str, str], has_keys: bool) -> None:
    """Write the file of this process. A folder that cannot be written to only means that it is not found."""
    with contextlib.suppress(OSError):
        path = _path(os.getpid())
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"addresses": dict(addresses), "keys": has_keys}), encoding="utf-8")


def withdraw() -> None:
    """Delete the file of this process."""
    with contextlib.suppress(OSError):
        _path(os.getpid()).unlink()


def running_servers() -> list[RunningServer]:
    """The servers whose files lie there and whose processes are alive. Files of dead processes are deleted."""
    return list(_found(_folder()))


def _found(folder: Path) -> Iterator[RunningServer]:
    for path in sorted(folder.glob("*.json")) if folder.is_dir() else ():
        with contextlib.suppress(OSError, ValueError, TypeError, KeyError, AttributeError):
            pid = int(path.stem)
            if not _is_alive(pid):
                path.unlink()
                continue
            if path.stat().st_size <= MAX_BYTES:
                content = json.loads(path.read_text(encoding="utf-8"))
                addresses = {str(name): str(address) for name, address in content["addresses"].items()}
                yield RunningServer(pid, addresses, bool(content["keys"]))


def _path(pid: int) -> Path:
    return _folder() / f"{pid}.json"


def _folder() -> Path:
    return user_state_path("manipnet", appauthor=False) / "servers"


def _is_alive(pid: int) -> bool:
    if os.name == "nt":  # there, a signal would end the process; the doctor asks the server anyway
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
