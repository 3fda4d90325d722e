"""Bodies over ZeroMQ: a bound SUB socket with its own thread; messages as in `docs/protocol-in.md`."""

import threading
import time

import zmq

from manipnet.inputs.base import Intake, Sink
from manipnet.net.access_control import AccessControl
from manipnet.net.connection_limits import Connections
from manipnet.net.curve_keys import KeyFileError, ServerKeys
from manipnet.net.errors import ListenError
from manipnet.net.rate_limit import SourceRateLimiter
from manipnet.net.zmq_socket import harden, zmq_endpoint
from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import MAX_MESSAGE_BYTES, MessageError, parse_bodies


class ZmqBodies:
    """Receives body messages on `tcp://host:port`; port 0 takes a free one, see `address` after `start`.

    With `keys`, connections are encrypted and only clients on the list may send.
    """

    def __init__(
        self,
        sink: Sink,
        telemetry: Telemetry,
        host: str = "127.0.0.1",
        port: int = 5556,
        keys: ServerKeys | None = None,
    ) -> None:
        self._intake = Intake("zmq", sink, telemetry)
        self._telemetry, self._keys = telemetry, keys
        self._guard = SourceRateLimiter()
        self._endpoint, self._ipv6 = zmq_endpoint(host, port)
        self._context: zmq.Context | None = None
        self._access: AccessControl | None = None
        self._thread: threading.Thread | None = None
        self.address = self._endpoint

    def start(self) -> None:
        """Bind and begin to receive; raises `ListenError` when the address cannot be bound."""
        context = zmq.Context()
        subscriber = context.socket(zmq.SUB)
        harden(subscriber, self._ipv6)
        subscriber.subscribe(b"")
        try:
            access = AccessControl(context, subscriber, self._telemetry, self._keys)
            subscriber.bind(self._endpoint)
        except (zmq.ZMQError, KeyFileError) as error:
            subscriber.close()
            context.term()
            if isinstance(error, KeyFileError):
                raise
            raise ListenError(
                f"cannot listen for bodies on {self._endpoint}: {zmq.strerror(error.errno or 0)}; "
                "choose a free port (0 takes any) and an address of this machine"
            ) from None
        self.address = subscriber.getsockopt_string(zmq.LAST_ENDPOINT)
        self._context, self._access = context, access
        # The socket changes hands here, once, and belongs to the thread from now on.
        self._thread = threading.Thread(
            target=self._run, args=(subscriber, access.connections), name="zmq-bodies", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Stop receiving and free the port; returns when both are done. Harmless when not started."""
        if self._thread is None or self._context is None or self._access is None:
            return
        self._context.term()  # wakes the thread with ContextTerminated and waits until it closed its socket
        self._thread.join()
        self._access.join()
        self._thread = self._context = self._access = None

    def connected(self) -> int:
        """How many senders there are at present. From any thread."""
        return 0 if self._access is None else len(self._access.connections)

    def _run(self, subscriber: zmq.Socket, connections: Connections) -> None:
        with subscriber:
            skipping = False
            while True:
                try:
                    part = subscriber.recv(copy=False)
                except zmq.ContextTerminated:
                    return
                connections.delivered(part.get(zmq.SRCFD))
                if part.more or skipping:  # every part of a multipart message passes here, only its last counts
                    skipping = part.more
                    if not skipping:
                        self._intake.drop("malformed", _source(part), "a message of several frames; send one")
                    continue
                self._receive(part)

    def _receive(self, part: zmq.Frame) -> None:
        now_s = time.monotonic()
        source = _source(part)
        if not self._guard.admits(source, now_s):
            self._intake.drop("rate", source, "too many messages that cannot be used")
            return
        try:
            frame = parse_bodies(part.bytes, now_s, source)
        except MessageError as error:
            self._guard.bad(source)
            reason = "oversized" if len(part.buffer) > MAX_MESSAGE_BYTES else "malformed"
            self._intake.drop(reason, source, error)
            return
        self._guard.good(source)
        self._intake.accept(frame)


def _source(part: zmq.Frame) -> str:
    """The peer's address and its connection's descriptor, which tells two senders of one machine apart."""
    return f"zmq:{part.get('Peer-Address')}#{part.get(zmq.SRCFD)}"
