"""A whole server: `Server` loads what is configured, opens every socket and runs the tick loop."""

from manipnet.server.server import Server

__all__ = ["Server"]
