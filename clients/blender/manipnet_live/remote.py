"""Remote control of the server from the panel. A thread sends the requests, so that Blender never waits for one."""

from __future__ import annotations

import queue
from collections.abc import Mapping
from dataclasses import dataclass, field
from threading import Thread
from typing import Any

from .manipnet_client import ControlClient, RequestError

ASK_EVERY_S = 2.0
TIMEOUT_S = 2.0


@dataclass(frozen=True)
class ServerState:
    """What the server last said about itself: its objects, the bodies of each actor, and the running recording."""

    objects: tuple[str, ...] = ()
    bodies: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """For each actor and body, the object that the body carries."""
    recording: str | None = None


class Remote:
    """Sends requests to the server at `address`, in order, and keeps what the server says about itself."""

    def __init__(self, address: str) -> None:
        """Raises `ValueError` for a wrong address."""
        self._control = ControlClient(address, timeout_s=TIMEOUT_S)
        self._requests: queue.Queue[tuple[str, dict[str, Any]] | None] = queue.Queue()
        self.state = ServerState()
        self.message = ""
        """The result of the last request, or why the server refused it."""
        self.problem = ""
        """Why the server does not answer; empty if it does."""
        self._thread = Thread(target=self._run, name="manipnet-remote", daemon=True)
        self._thread.start()

    def send(self, op: str, **fields: Any) -> None:
        """Send a request of docs/protocol.md soon; its result becomes the `message`."""
        self._requests.put((op, fields))

    def close(self) -> None:
        """End the thread; a request that waits for its answer delays this by at most two seconds."""
        self._requests.put(None)
        self._thread.join()

    def _run(self) -> None:
        while True:
            self._look()
            try:
                request = self._requests.get(timeout=ASK_EVERY_S)
            except queue.Empty:
                continue
            if request is None:
                return
            self._ask(*request)

    def _ask(self, op: str, fields: dict[str, Any]) -> None:
        try:
            self.message = _described(op, self._control.ask(op, **fields))
        except RequestError as refusal:
            self.message = f"The server refuses: {refusal}"
        except (OSError, ValueError) as error:
            self.message = f"The server did not answer: {error}"

    def _look(self) -> None:
        try:
            known, takes = self._control.ask("objects"), self._control.ask("recordings")
            running = takes.get("recording")
            name = None if running is None else str(running["name"])
            self.state = ServerState(tuple(known["objects"]), known["bodies"], name)
            self.problem = ""
        except (OSError, ValueError, RequestError, KeyError) as error:
            self.problem = f"The server does not answer requests: {error}"


def _described(op: str, answer: dict[str, Any]) -> str:
    """One sentence about the answer to a request of the panel."""
    if op == "record":
        return f"Recording {answer['name']}"
    if op == "stop_recording":
        return f"Recorded {answer['name']}, {answer['seconds']:.1f} s"
    if op == "look_ahead":
        return f"Look-ahead is {answer['seconds']:.2f} s"
    if op == "select_object":
        return f"{answer.get('body', 'The body')} carries {answer['object']}"
    if op == "rest":
        return f"Hands of {', '.join(answer['actors'])} go to rest"
    return f"{op}: done"
