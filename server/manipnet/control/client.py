"""A client of the control port, for the tools and for other programs in Python."""

import json
from pathlib import Path
from typing import Any, Final

import zmq

from manipnet.config.settings import control_endpoint
from manipnet.control.request import RequestError
from manipnet.net.curve_keys import read_client_keys
from manipnet.net.zmq_socket import connect, tcp_address

ANSWER_S: Final = 10.0


class ControlClient:
    """Sends requests to the control port of a server, over one connection each. Any thread may call `ask`."""

    def __init__(self, address: str, keys: Path | None = None, timeout_s: float = ANSWER_S) -> None:
        """`address` is `HOST`, `HOST:PORT` or `tcp://HOST:PORT`; `keys` is a client's key file.

        Raises `ConfigError` for a malformed address and `KeyFileError` for a malformed key file.
        """
        self._endpoint = control_endpoint(address)
        self._keys = None if keys is None else read_client_keys(keys)
        self._timeout_s = timeout_s

    @property
    def address(self) -> str:
        """The server's address, `tcp://HOST:PORT`."""
        return tcp_address(self._endpoint)

    def ask(self, op: str, **fields: Any) -> dict[str, Any]:
        """Send the request `op` with its `fields`, as docs/protocol.md lists them, and return the answer.

        Raises `RequestError` with the server's own text when the server refuses the request, `TimeoutError` when no
        answer arrives in time, and `ConnectionError` when what answers is not a server of ours.
        """
        answer = self._exchange(json.dumps({"op": op, **fields}).encode())
        if "error" in answer:
            raise RequestError(answer["error"])
        return answer

    def _exchange(self, request: bytes) -> dict[str, Any]:
        with zmq.Context() as context:
            try:
                # An answer with a mesh may have any size.
                socket = connect(context, zmq.REQ, self._endpoint, self._keys, max_bytes=-1)
            except zmq.ZMQError as error:
                raise ConnectionError(f"cannot connect to {self.address}: {error}") from None
            with socket:
                socket.send(request)
                if not socket.poll(int(1e3 * self._timeout_s)):
                    raise TimeoutError(f"no server answers at {self.address} within {self._timeout_s:g} s")
                return self._decoded(socket.recv())

    def _decoded(self, payload: bytes) -> dict[str, Any]:
        try:
            answer = json.loads(payload)
        except ValueError:
            answer = None
        if not isinstance(answer, dict):
            raise ConnectionError(f"what answers at {self.address} is not a server of ManipNet Live")
        return answer
