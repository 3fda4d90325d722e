"""Requests to the server's control port: status, objects, look-ahead, pause, recording and the rest."""

from __future__ import annotations

import json
from os import PathLike
from typing import Any

from . import zmtp

MAX_REPLY_BYTES = 1 << 26
"""The largest reply is a mesh."""


class RequestError(Exception):
    """The server refused a request; the text is the server's own and says what was wrong and what is allowed."""


class ControlClient:
    """Sends requests to the control port of `manipnet-serve` at `address`, one connection for each.

    `keys` names the file that `manipnet keys make NAME` wrote, for a server that requires keys; it needs pyzmq. A
    request without a reply after `timeout_s` fails. Any thread may call `ask`. Raises `ValueError` for a wrong address
    or a wrong file of keys.
    """

    def __init__(
        self,
        address: str = "tcp://127.0.0.1:5557",
        keys: str | PathLike[str] | None = None,
        timeout_s: float = 10.0,
    ) -> None:
        self._address, self._timeout_s = address, timeout_s
        self._host, self._port = zmtp.parse_address(address)
        self._keys = None
        if keys is not None:
            from .curve import read_keys  # pyzmq is needed only with keys

            self._keys = read_keys(keys)

    def ask(self, op: str, **fields: Any) -> dict[str, Any]:
        """Send the request `op` with its `fields`, as docs/protocol.md lists them, and return the server's reply.

        Raises `RequestError` when the server refuses, `TimeoutError` when no reply arrives in time, and
        `ConnectionError` when the server cannot be reached.
        """
        body = json.dumps({"op": op, **fields}).encode()
        try:
            reply = json.loads(self._send(body))
        except TimeoutError:
            raise TimeoutError(f"{self._address} did not answer {op!r} within {self._timeout_s:g} s") from None
        except OSError as error:
            raise ConnectionError(f"cannot send {op!r} to {self._address}: {error}") from error
        if "error" in reply:
            raise RequestError(reply["error"])
        return reply

    def select_object(self, body: str, object: str, scale: float = 1.0, actor: str | None = None) -> dict[str, Any]:
        """Let a tracked body carry an object of the server; returns the selection now in force. Raises as `ask`."""
        chosen = {} if actor is None else {"actor": actor}
        return self.ask("select_object", body=body, object=object, scale=scale, **chosen)

    def look_ahead(self, seconds: float) -> float:
        """Set how much future motion the synthesis waits for; returns the seconds now in force. Raises as `ask`."""
        return self.ask("look_ahead", seconds=seconds)["seconds"]

    def record(self, name: str | None = None) -> str:
        """Begin a recording on the server's machine; returns its name. Raises as `ask`."""
        return self.ask("record", **({} if name is None else {"name": name}))["name"]

    def stop_recording(self) -> dict[str, Any]:
        """End the recording; returns its name, its seconds and what is in it. Raises as `ask`."""
        return self.ask("stop_recording")

    def upload_hand(self, profile: dict[str, Any], actor: str | None = None) -> str:
        """Upload the hands of an avatar and return the name to pass to `Client` as `hand`.

        `profile` is a hand profile as docs/any-hand.md describes it, for example a file of `manipnet hand import`. The
        server forgets it when nobody has subscribed to it for a minute. Raises what `ask` raises.
        """
        more = {} if actor is None else {"actor": actor}
        return str(self.ask("hand_profile", profile=profile, **more)["name"])

    def _send(self, body: bytes) -> bytes:
        if self._keys is None:
            return zmtp.request(self._host, self._port, body, MAX_REPLY_BYTES, self._timeout_s)
        from . import curve

        return curve.request(self._host, self._port, body, MAX_REPLY_BYTES, self._keys, self._timeout_s)
