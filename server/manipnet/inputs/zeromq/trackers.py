"""Connects to trackers that bind a PUB socket, and reads their body messages on a thread of its own."""

import threading
from typing import Any, Final

import zmq
from zmq.utils.monitor import parse_monitor_message

from manipnet.common.options import Endpoint
from manipnet.inputs.base import Intake
from manipnet.inputs.zeromq.messages import BodyMessages
from manipnet.net.errors import ListenError
from manipnet.net.supervised import ReceiverHealth, SupervisedThread
from manipnet.net.zmq_socket import connect, tcp_address

_EVENTS: Final = zmq.Event.HANDSHAKE_SUCCEEDED | zmq.Event.DISCONNECTED
POLL_MS: Final = 100


class TrackerConnections:
    """Connections to trackers, which are made again whenever they break."""

    def __init__(self, intake: Intake, endpoints: tuple[Endpoint, ...]) -> None:
        self._endpoints = endpoints
        self.messages = BodyMessages(intake)
        self._intake = intake
        self._connected: dict[str, bool] = {tcp_address(endpoint): False for endpoint in endpoints}
        self._lock = threading.Lock()
        self._thread: SupervisedThread | None = None
        self._sockets: list[tuple[str, zmq.Socket, zmq.Socket]] = []

    def start(self) -> None:
        """Begin to connect. Raises `ListenError` for an impossible address."""
        self._context = zmq.Context()
        self._health = ReceiverHealth("zmq-connect", self._intake.telemetry)
        try:
            self._open()
        except ListenError:
            self._close()
            self._context.term()
            raise
        self._thread = SupervisedThread("zmq-connect", self._health, self._run, self._reopen)
        self._thread.start()

    def stop(self) -> None:
        """Disconnect. Does nothing if it was not started."""
        if self._thread is not None:
            self._thread.stopping.set()
            self._thread.join()
            self._thread = None
            self._close()
            self._context.term()

    def status(self) -> dict[str, Any]:
        """By address, whether the tracker there is connected. From any thread."""
        with self._lock:
            return dict(self._connected)

    def _open(self) -> None:
        for endpoint in self._endpoints:
            address = tcp_address(endpoint)
            try:
                subscriber = connect(self._context, zmq.SUB, endpoint)
            except zmq.ZMQError as error:
                raise ListenError(f"cannot connect to {address}: {zmq.strerror(error.errno or 0)}") from None
            subscriber.subscribe(b"")
            self._sockets.append((address, subscriber, subscriber.get_monitor_socket(_EVENTS)))

    def _close(self) -> None:
        for _, subscriber, monitor in self._sockets:
            subscriber.disable_monitor()
            monitor.close()
            subscriber.close()
        self._sockets.clear()

    def _reopen(self) -> None:
        self._close()
        self._open()

    def _run(self) -> None:
        """Read until `stopping` is set. Raises `zmq.ZMQError` when a socket has failed."""
        assert self._thread is not None
        poller = zmq.Poller()
        for _, subscriber, monitor in self._sockets:
            poller.register(subscriber, zmq.POLLIN)
            poller.register(monitor, zmq.POLLIN)
        while not self._thread.stopping.is_set():
            ready = dict(poller.poll(POLL_MS))
            for address, subscriber, monitor in self._sockets:
                if monitor in ready:
                    self._note(address, parse_monitor_message(monitor.recv_multipart()))
                if subscriber in ready:
                    self._read(subscriber)

    def _read(self, subscriber: zmq.Socket) -> None:
        part = subscriber.recv(copy=False)
        try:
            self.messages.take(part)
        except Exception:
            self._health.message_failed()

    def _note(self, address: str, event: dict[str, Any]) -> None:
        with self._lock:
            self._connected[address] = event["event"] == zmq.Event.HANDSHAKE_SUCCEEDED
