"""A viser server on a given socket, without a public tunnel, that admits only pages of its own."""

import asyncio
import contextlib
import socket
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from http import HTTPStatus
from importlib.resources import files
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from manipnet.net.addresses import is_loopback
from manipnet.outputs.websocket.server import LOCAL_PAGES

OPERATOR: Final = ContextVar("OPERATOR", default=False)
"""Whether the current connection may change anything, which needs a page and a visitor on this machine."""
SCRIPT: Final = files("manipnet.page").joinpath("page.js").read_text(encoding="utf-8")
"""The script that the page adds to viser's client: a title, and the import of dropped files."""
DROP_PATH: Final = "/drop"
_POLICY_VIOLATION: Final = 1008

Dropped = Callable[[str, bytes], str]


class Server(viser.ViserServer):
    """Viser without its public tunnel, which any visitor could open."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Open no tunnel."""
        return None


def open_server(listener: socket.socket, label: str, dropped: Dropped) -> Server:
    """Serve on a socket that already listens; on loopback, only pages of this machine are admitted.

    `dropped` receives the name and content of a file that an operator dropped on the page, and returns a message.
    """
    with _served_on(listener, dropped):
        return Server(host="127.0.0.1", port=0, label=label, verbose=False)


@contextlib.contextmanager
def _served_on(listener: socket.socket, dropped: Dropped) -> Iterator[None]:
    """Replace the function with which viser serves, which has no option for a socket or for allowed origins."""
    original = websockets.asyncio.server.serve
    exposed = not is_loopback(listener.getsockname()[0])

    def serve(handler: Any, _host: str, _port: int, *, process_request: Any, **options: Any) -> Any:
        async def handle(connection: ServerConnection) -> None:
            request = connection.request
            assert request is not None
            OPERATOR.set(may_operate(connection.remote_address[0], request.headers))
            if urlsplit(request.path).path == DROP_PATH:
                await _receive_file(connection, request, dropped)
            else:
                await handler(connection)

        def answer(connection: ServerConnection, request: Request) -> Response | None:
            if not may_view(request.headers, exposed):
                return connection.respond(HTTPStatus.FORBIDDEN, "Other web sites may not use this page.\n")
            with contextlib.suppress(KeyError):  # the script can only be added to an uncompressed page
                del request.headers["Accept-Encoding"]
            response = process_request(connection, request)
            return _with_script(response) if urlsplit(request.path).path == "/" else response

        return original(handle, sock=listener, process_request=answer, **options)

    websockets.asyncio.server.serve = serve  # pyright: ignore[reportAttributeAccessIssue]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = original  # pyright: ignore[reportAttributeAccessIssue]


def may_view(headers: Any, exposed: bool) -> bool:
    """Whether a request is admitted: one from a page of this machine, from a program that is not a page or, if other
    machines are admitted, from the page itself. Other web sites in the same browser are not admitted."""
    origin, host = headers.get("Origin"), headers.get("Host", "")
    local = LOCAL_PAGES.fullmatch(f"http://{host}") is not None
    if origin is None:
        return local or exposed
    return (local and LOCAL_PAGES.fullmatch(origin) is not None) or (exposed and origin == f"http://{host}")


def may_operate(address: str, headers: Any) -> bool:
    """Whether a visitor may change anything: only on this machine, through a loopback address."""
    return is_loopback(address) and may_view(headers, exposed=False)


async def _receive_file(connection: ServerConnection, request: Request, dropped: Dropped) -> None:
    """Receive one dropped file, with its name in the query and its content in the only message."""
    if not OPERATOR.get():
        await connection.close(_POLICY_VIOLATION, "only a visitor on the server's own machine can import files")
        return
    name = parse_qs(urlsplit(request.path).query).get("name", ["mesh"])[0]
    with contextlib.suppress(ConnectionClosed):
        content = await connection.recv(decode=False)
        await connection.send(await asyncio.to_thread(dropped, name, content))


def _with_script(response: Response | None) -> Response | None:
    if response is not None and response.status_code == HTTPStatus.OK:
        response.body = (response.body or b"").replace(b"</body>", f"<script>{SCRIPT}</script></body>".encode(), 1)
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))
    return response
