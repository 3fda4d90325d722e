"""Hands over WebSocket, for browsers."""

from dataclasses import dataclass
from pathlib import Path

from manipnet.common.options import File, Port, option
from manipnet.outputs.declaration import Emission, HandsOutput, Output


@dataclass(frozen=True)
class WebSocketOptions:
    """Where hands are published over WebSocket."""

    web_port: int = option(8081, Port(), "TCP port for browsers that receive hands over WebSocket")
    web_token: Path | None = option(
        None, File(), "let pages and programs of any machine receive hands over WebSocket that know the token in FILE"
    )


def _open(options: WebSocketOptions, emission: Emission) -> HandsOutput:
    from manipnet.outputs.websocket.server import WebSocketPublisher
    from manipnet.outputs.websocket.token import read_token

    token = None if options.web_token is None else read_token(options.web_token)
    is_open = emission.keys is None or token is not None  # browsers have no keys
    host = emission.host if is_open else "127.0.0.1"
    return WebSocketPublisher(emission.telemetry, host, options.web_port, token, emission.submit)


WEBSOCKET = Output("web", "WebSocket: the `pose/bin` payload, for browsers", WebSocketOptions, _open)
