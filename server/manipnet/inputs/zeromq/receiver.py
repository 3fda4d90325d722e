"""Receives body messages, which `docs/protocol-in.md` describes, on a bound SUB socket with a thread of its own."""

from typing import Any

import zmq

from manipnet.common.options import Endpoint
from manipnet.inputs.base import Intake
from manipnet.inputs.declaration import Receiver
from manipnet.inputs.zeromq.messages import BodyMessages
from manipnet.inputs.zeromq.trackers import TrackerConnections
from manipnet.net.curve_keys import ServerKeys
from manipnet.net.errors import ListenError
from manipnet.net.supervised import ReceiverHealth, SupervisedThread
from manipnet.net.zmq_socket import BoundSocket


class ZmqBodies(Receiver):
    """Receives body messages on `tcp://host:port`. Port 0 takes any free port, which `address` names after `start`.

    With `keys`, connections are encrypted and only clients on the list of keys may send. Messages also come from the
    `trackers` that bind their sockets, to which it connects, without keys.
    """

    def __init__(
        self,
        intake: Intake,
        host: str = "127.0.0.1",
        port: int = 5556,
        keys: ServerKeys | None = None,
        trackers: tuple[Endpoint, ...] = (),
    ) -> None:
        self._intake, self._keys = intake, keys
        self._messages = BodyMessages(intake)
        self._trackers = TrackerConnections(intake, trackers) if trackers else None
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
        if self._trackers is not None:
            try:
                self._trackers.start()
            except ListenError:
                self.stop()
                raise

    def stop(self) -> None:
        """Stop receiving and free the port. Does nothing if the receiver was not started."""
        if self._thread is None:
            return
        if self._trackers is not None:
            self._trackers.stop()
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

    def status(self) -> dict[str, Any]:
        """The clocks of the senders, and by address, whether the trackers to connect to are connected."""
        if self._trackers is None:
            return {"senders": self._messages.status(), "trackers": {}}
        senders = {**self._messages.status(), **self._trackers.messages.status()}
        return {"senders": senders, "trackers": self._trackers.status()}

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
            while True:
                part = subscriber.recv(copy=False)
                try:
                    bound.delivered(part)
                    self._messages.take(part)
                except Exception:
                    self._health.message_failed()
