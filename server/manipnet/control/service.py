"""Requests from clients: a REP socket on a thread of its own, which answers in the encoding of the request."""

import json
import logging
import threading
import time
from collections.abc import Mapping
from typing import Final

import msgpack
import zmq

from manipnet.control.request import Handler, Request, RequestError, quoted
from manipnet.net.addresses import is_loopback
from manipnet.net.curve_keys import ServerKeys
from manipnet.net.errors import ListenError
from manipnet.net.rate_limit import Throttle
from manipnet.net.zmq_socket import BoundSocket
from manipnet.telemetry import CONTROL_OPS, Telemetry

MAX_REQUEST_BYTES: Final = 4096
REQUESTS_PER_S: Final = 200
BURST: Final = 50
"""Totals over all clients; above them, replies are delayed to protect tick time."""
LOCAL_OPS: Final = ("add_object",)
"""Operations that open files of the server's machine."""
_OPS: Final = tuple(op for op in CONTROL_OPS if op != "invalid")
_log = logging.getLogger(__name__)


class Control:
    """Answers requests on `tcp://host:port` with `handlers`, one per operation, which run on the control thread."""

    def __init__(
        self,
        host: str,
        port: int,
        handlers: Mapping[str, Handler],
        telemetry: Telemetry,
        keys: ServerKeys | None = None,
    ) -> None:
        """Bind the socket; `start` begins to answer. With `keys`, only clients on their list may ask.

        Raises `ListenError`.
        """
        self._handlers, self._telemetry, self._throttle = handlers, telemetry, Throttle(REQUESTS_PER_S, BURST)
        try:
            self._bound = BoundSocket(zmq.REP, host, port, telemetry, keys, MAX_REQUEST_BYTES)
        except ListenError as error:
            raise ListenError(f"--control-port: {error}") from None
        self.address = self._bound.address
        self._thread = threading.Thread(target=self._run, name="control", daemon=True)

    def start(self) -> None:
        """Begin to answer."""
        self._thread.start()

    def stop(self) -> None:
        """Stop answering and free the port."""
        if self._thread.is_alive():
            self._bound.interrupt()
            self._thread.join()
        else:
            self._bound.close()

    def connected(self) -> int:
        """The number of connected clients. From any thread."""
        return self._bound.connected()

    def _run(self) -> None:
        with self._bound.socket as rep:
            while True:
                try:
                    frames = rep.recv_multipart(copy=False)
                    self._bound.delivered(frames[0])
                    time.sleep(self._throttle.delay_s(time.monotonic()))
                    here = is_loopback(str(frames[0].get("Peer-Address")))
                    rep.send(self.answer([frame.bytes for frame in frames], here))
                except zmq.ContextTerminated:
                    return
                except zmq.ZMQError as error:
                    _log.warning("control: an answer was lost: %s", error)

    def answer(self, parts: list[bytes], here: bool = True) -> bytes:
        """The answer to one message, whatever it holds; `here` tells whether it comes from this machine."""
        as_json = bool(parts) and parts[0].lstrip()[:1] in (b"{", b"[")
        op = "invalid"
        try:
            request = _decode(parts)
            op = _operation(request)
            if op in LOCAL_OPS and not here:
                raise RequestError(
                    f"{op} opens files of the server's machine, so only a client on that machine may ask; put the mesh "
                    "into the server's folder --objects and use select_object, or drop the mesh on the live page there"
                )
            reply = self._handlers[op](request)
        except RequestError as error:
            reply = {"error": str(error)}
        except Exception as error:
            _log.exception("control: the request %s failed", op)
            reply = {"error": f"{op} failed because of a fault in the server: {type(error).__name__}: {error}"}
        self._telemetry.count("control_requests", op=op)
        return json.dumps(reply).encode() if as_json else msgpack.packb(reply) or b""


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


def _operation(request: Request) -> str:
    op = request.get("op")
    if not isinstance(op, str) or op not in _OPS:
        raise RequestError(f"op is {quoted(op)}; allowed are {', '.join(_OPS)}")
    return op
