"""Handles requests: each is decoded, passed to the handler of its operation, and answered in its own encoding.

Operations that may take seconds (a mesh is built, a process starts) run on a thread for each kind, so that `pause`
never waits for them.
"""

import contextlib
import json
import logging
import queue
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import msgpack

from manipnet.control.request import Handler, Request, RequestError, quoted
from manipnet.telemetry import CONTROL_OPS, Telemetry

LOCAL_OPS: Final = {
    "add_object": (
        "opens files of the server's machine, so only a client on that machine may ask; put the mesh into the server's "
        "folder --objects and use select_object, or drop the mesh on the live page there"
    ),
    "edit_recording": "changes files of the server's machine, so only a client on that machine may ask",
    "delete_recording": "deletes files of the server's machine, so only a client on that machine may ask",
    "save_rig": "changes the rig file on the server's machine, so only a client on that machine may ask",
}
"""Operations that only a client on the server's machine may ask for, and why."""
STORING_OPS: Final = ("calibrate", "place_object")
"""Operations that change the rig file on the server's machine unless the request has `"store": false`."""
SLOW_OPS: Final = {
    "add_object": "objects",
    "hand_profile": "hands",
    "select_object": "selection",
    "record": "recording",
    "stop_recording": "recording",
    "edit_recording": "recording",
    "delete_recording": "recording",
    "calibrate": "rig",
    "place_object": "rig",
    "save_rig": "rig",
}
"""Operations that may take long, and the thread that does them; requests on one thread keep their order."""
MAX_WAITING: Final = 16
"""Requests that wait for one of these threads; beyond it they are refused."""
_OPS: Final = tuple(op for op in CONTROL_OPS if op != "invalid")
_log = logging.getLogger(__name__)

Reply = Callable[[bytes], object]
"""Takes the answer to a request, on any thread."""


class Dispatcher:
    """Passes requests to `handlers`, one per operation. `submit` may be called from any thread."""

    def __init__(self, handlers: Mapping[str, Handler], telemetry: Telemetry) -> None:
        self._handlers, self._telemetry = handlers, telemetry
        self._waiting: dict[str, queue.Queue[Callable[[], None] | None]] = {}
        """The slow requests of each thread that has had any."""
        self._lock = threading.Lock()

    def submit(self, parts: list[bytes], reply: Reply, here: bool = True, ops: Sequence[str] = _OPS) -> None:
        """Handle one message, whatever it contains. Pass the answer to `reply`, later if the operation is slow.

        `here` says whether the message comes from this machine. `ops` are the operations that its sender may use.
        """
        as_json = bool(parts) and parts[0].lstrip()[:1] in (b"{", b"[")

        def answer(content: dict[str, Any], op: str) -> None:
            self._telemetry.count("control_requests", op=op)
            reply(json.dumps(content).encode() if as_json else msgpack.packb(content) or b"")

        op = "invalid"
        try:
            request = _decode(parts)
            op = _operation(request, ops)
            if op in LOCAL_OPS and not here:
                raise RequestError(f"{op} {LOCAL_OPS[op]}")
            if op in STORING_OPS and not here and request.get("store") is not False:
                raise RequestError(
                    f"{op} stores its result in the rig file on the server's machine, so only a client on that machine "
                    'may ask; add "store": false to let the result be in force until the server stops'
                )
            if op not in SLOW_OPS:
                answer(self._answer_to(op, request), op)
                return
            self._queue(SLOW_OPS[op]).put_nowait(lambda: answer(self._answer_to(op, request), op))
        except RequestError as error:
            answer({"error": str(error)}, op)
        except queue.Full:
            answer({"error": f"{op} cannot start: {MAX_WAITING} requests of its kind are waiting; try again later"}, op)

    def close(self) -> None:
        """Let the threads end after their current request."""
        with self._lock:
            for waiting in self._waiting.values():
                with contextlib.suppress(queue.Empty):
                    while True:
                        waiting.get_nowait()
                waiting.put(None)

    def _queue(self, name: str) -> "queue.Queue[Callable[[], None] | None]":
        with self._lock:
            if name not in self._waiting:
                self._waiting[name] = queue.Queue(MAX_WAITING)
                threading.Thread(target=_work, args=(self._waiting[name],), name=f"control-{name}", daemon=True).start()
            return self._waiting[name]

    def _answer_to(self, op: str, request: Request) -> dict[str, Any]:
        try:
            return self._handlers[op](request)
        except RequestError as error:
            return {"error": str(error)}
        except Exception as error:
            _log.exception("control: the request %s failed", op)
            return {"error": f"{op} failed because of a fault in the server: {type(error).__name__}: {error}"}


def _work(waiting: "queue.Queue[Callable[[], None] | None]") -> None:
    while (task := waiting.get()) is not None:
        try:
            task()
        except Exception:
            _log.exception("control: an answer could not be sent")


def _decode(parts: list[bytes]) -> Request:
    if len(parts) != 1:
        raise RequestError(f"the request has {len(parts)} frames; send one, a msgpack or JSON map")
    try:
        text = parts[0].lstrip()
        request = json.loads(text) if text[:1] in (b"{", b"[") else msgpack.unpackb(parts[0])
    except Exception as error:  # the decoders raise a dozen types of errors
        reason = str(error)[:80] or type(error).__name__
        raise RequestError(f"the request is neither a msgpack nor a JSON map: {reason}") from None
    if not isinstance(request, dict):
        raise RequestError(f"the request is of type {type(request).__name__}; it must be a map with the key op")
    return request


def _operation(request: Request, allowed: Sequence[str]) -> str:
    op = request.get("op")
    if not isinstance(op, str) or op not in allowed:
        raise RequestError(f"op is {quoted(op)}; allowed {'are' if len(allowed) > 1 else 'is'} {', '.join(allowed)}")
    return op
