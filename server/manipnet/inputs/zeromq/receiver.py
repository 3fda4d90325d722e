"""Receives body messages, which `docs/protocol-in.md` describes, on a bound SUB socket with a thread of its own."""

import time

import zmq

from manipnet.inputs.base import Intake
from manipnet.inputs.declaration import Receiver
from manipnet.net.curve_keys import ServerKeys
from manipnet.net.rate_limit import SourceRateLimiter
from manipnet.net.supervised import ReceiverHealth, SupervisedThread
from manipnet.net.zmq_socket import BoundSocket
from manipnet.wire.bodies import MAX_MESSAGE_BYTES, MessageError, parse_bodies


class ZmqBodies(Receiver):
    """Receives body messages on `tcp://host:port`. Port 0 takes any free port, which `address` names after `start`.

    With `keys`, connections are encrypted and only clients on the list of keys may send.
    """

    def __init__(
        self, intake: Intake, host: str = "127.0.0.1", port: int = 5556, keys: ServerKeys | None = None
    ) -> None:
        self._intake, self._keys = intake, keys
        self._rate_limiter = SourceRateLimiter()
        self._host, self._port = host, port
        self._bound: BoundSocket | None = None
        self._thread: SupervisedThread | None = None
        self.address = f"tcp://{host}:{port}"

    def start(self) -> None:
        """Bind and begin to receive. Raises `ListenError` and `KeyFileError`."""
        self._bound = self._bind(self._port)
        self.address = self._bound.address
        self._health = ReceiverHealth(self._intake.protocol, self._intake.telemetry)
        # From here on, the socket belongs to the thread.
        self._thread = SupervisedThread("zmq-bodies", self._health, self._run, self._reopen)
        self._thread.start()

    def stop(self) -> None:
        """Stop receiving and free the port. Does nothing if the receiver was not started."""
        if self._thread is None:
            return
        self._thread.stopping.set()
        if (bound := self._bound) is not None:
            bound.interrupt()
        self._thread.join()
        if (bound := self._bound) is not None:  # it was opened again in the meantime
            bound.close()
        self._thread = self._bound = None

    def connected(self) -> int:
        """The number of senders that are connected. From any thread."""
        bound = self._bound
        return 0 if bound is None else bound.connected()

    def _bind(self, port: int) -> BoundSocket:
        bound = BoundSocket(zmq.SUB, self._host, port, self._intake.telemetry, self._keys)
        bound.socket.subscribe(b"")
        return bound

    def _reopen(self) -> None:
        if self._bound is not None:
            self._bound.close()
            self._bound = None
        self._bound = self._bind(int(self.address.rpartition(":")[2]))

    def _run(self) -> None:
        """Receive until the context is terminated, which raises `zmq.ContextTerminated`."""
        bound = self._bound
        assert bound is not None
        with bound.socket as subscriber:
            skipping = False
            while True:
                part = subscriber.recv(copy=False)
                try:
                    skipping = self._take(bound, part, skipping)
                except Exception:
                    skipping = part.more
                    self._health.message_failed()

    def _take(self, bound: BoundSocket, part: zmq.Frame, skipping: bool) -> bool:
        """Take one part; returns whether the rest of its message is skipped."""
        bound.delivered(part)
        if part.more:
            return True
        if skipping:  # the parts of a multipart message are skipped; its last one is reported
            self._intake.drop("malformed", _source(part), "the message has several frames; send one")
        else:
            self._receive(part)
        return False

    def _receive(self, part: zmq.Frame) -> None:
        now_s = time.monotonic()
        source = _source(part)
        if not self._rate_limiter.admits(source, now_s):
            self._intake.drop("rate", source, "too many messages that cannot be used")
            return
        try:
            frame = parse_bodies(part.bytes, now_s, source)
        except MessageError as error:
            self._rate_limiter.bad(source)
            reason = "oversized" if len(part.buffer) > MAX_MESSAGE_BYTES else "malformed"
            self._intake.drop(reason, source, error)
            return
        self._rate_limiter.good(source)
        self._intake.accept(frame)


def _source(part: zmq.Frame) -> str:
    """The peer's address and the descriptor of its connection, which tells two senders on one machine apart."""
    return f"zmq:{part.get('Peer-Address')}#{part.get(zmq.SRCFD)}"
