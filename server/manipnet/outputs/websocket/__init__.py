"""Hands over WebSocket, for browsers."""

from dataclasses import dataclass

from manipnet.common.options import Port, option
from manipnet.outputs.declaration import Emission, HandsOutput, Output


@dataclass(frozen=True)
class WebSocketOptions:
    """Where hands are published over WebSocket."""

    web_port: int = option(8081, Port(), "TCP port for browsers that receive hands over WebSocket")


def _open(options: WebSocketOptions, emission: Emission) -> HandsOutput:
    from manipnet.outputs.websocket.server import WebSocketPublisher

    host = emission.host if emission.keys is None else "127.0.0.1"  # browsers have no keys
    return WebSocketPublisher(emission.telemetry, host, options.web_port)


WEBSOCKET = Output("web", "WebSocket: the `pose/bin` payload, for browsers", WebSocketOptions, _open)
