"""A viser server on a given socket that answers only its own pages and opens no public tunnel."""

import asyncio
import contextlib
import logging
import socket
from collections import Counter
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
from manipnet.net.half_open import BACKLOG, HalfOpen
from manipnet.page import policy

OPERATOR: Final = ContextVar("OPERATOR", default=False)
"""Whether the visitor may change anything: a browser on this machine that shows a page of this machine."""
SCRIPT: Final = "".join(
    files("manipnet.page").joinpath(name).read_text(encoding="utf-8") for name in ("page.js", "changes.js")
)
"""What the page adds to viser's client: its title, files that are dropped on it, keys, and changes kept in order."""
STYLE: Final = files("manipnet.page").joinpath("page.css").read_text(encoding="utf-8")
DROP_PATH: Final = "/drop"
OPEN_S: Final = 10.0
"""A visitor that has not sent a whole request after this time is cut off."""
MAX_VISITORS: Final = 16
"""Operators, and as many other visitors, who can only watch and so take no place from an operator."""
MAX_DROPS: Final = 2
"""Files of up to 50 MB that are taken in at once."""
DROP_S: Final = 30.0
"""A visitor who has not sent the whole file after this time is cut off."""
_POLICY_VIOLATION: Final = 1008
_TRY_AGAIN_LATER: Final = 1013

Dropped = Callable[[str, bytes], str]
_log = logging.getLogger(__name__)


class PageServer(viser.ViserServer):
    """Viser without its public tunnel, which any visitor could open otherwise."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Nothing is shared."""
        return None


def open_server(listener: socket.socket, label: str, dropped: Dropped) -> PageServer:
    """Serve on a socket that already listens; on loopback, only pages of this machine may connect.

    `dropped` receives the name and content of a file that an operator dropped on the page, and returns a message.
    """
    with _served_on(listener, dropped):
        return PageServer(host="127.0.0.1", port=0, label=label, verbose=False)


@contextlib.contextmanager
def _served_on(listener: socket.socket, dropped: Dropped) -> Iterator[None]:
    """Viser has no option for a socket or for origins, so the function that it calls is replaced meanwhile."""
    original = websockets.asyncio.server.serve
    taking: set[object] = set()
    visitors: Counter[bool] = Counter()
    exposed = not is_loopback(listener.getsockname()[0])

    def serve(handler: Any, _host: str, _port: int, *, process_request: Any, **options: Any) -> Any:
        async def handle(connection: ServerConnection) -> None:
            request = connection.request
            assert request is not None
            OPERATOR.set(may_act(connection.remote_address[0], request.headers))
            if urlsplit(request.path).path == DROP_PATH:
                await _take_in(connection, request, dropped, taking)
            else:
                await _visit(connection, handler, visitors)

        def answer(connection: ServerConnection, request: Request) -> Response | None:
            if not may_look(request.headers, exposed):
                return connection.respond(HTTPStatus.FORBIDDEN, "This page is not for other web sites.\n")
            if (reason := policy.refusal(request)) is not None:
                return connection.respond(HTTPStatus.BAD_REQUEST, reason)
            with contextlib.suppress(KeyError):  # the script is inserted into the uncompressed page
                del request.headers["Accept-Encoding"]
            response = process_request(connection, request)
            if response is not None and policy.is_page(response, request):
                policy.protect(response, SCRIPT, STYLE)
            return response

        return original(
            handle,
            sock=listener,
            process_request=answer,
            create_connection=HalfOpen().connection,
            open_timeout=OPEN_S,
            backlog=BACKLOG,
            **options,
        )

    websockets.asyncio.server.serve = serve  # pyright: ignore[reportAttributeAccessIssue]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = original  # pyright: ignore[reportAttributeAccessIssue]


def may_look(headers: Any, exposed: bool) -> bool:
    """Whether a request comes from the page itself or from no page at all, through an address of this machine or, where
    other machines are let in, through any: no other web site open in the same browser may look, also none of this
    machine."""
    host, origin = headers.get("Host", ""), headers.get("Origin")
    return policy.is_own_page(headers) or (exposed and origin in (None, f"http://{host}"))


def may_act(address: str, headers: Any) -> bool:
    """Whether a visitor may change anything: one on this machine, through an address of this machine only."""
    return is_loopback(address) and may_look(headers, exposed=False)


async def _visit(connection: ServerConnection, handler: Any, visitors: Counter[bool]) -> None:
    """Serve one visitor until he leaves. `visitors` counts those who are here, by whether they are operators."""
    operator = OPERATOR.get()
    if visitors[operator] >= MAX_VISITORS:
        _log.warning("refused a visitor, since %d are here already", visitors.total())
        await connection.close(_TRY_AGAIN_LATER, f"at most {MAX_VISITORS} visitors")
        return
    visitors[operator] += 1
    try:
        await handler(connection)
    finally:
        visitors[operator] -= 1


async def _take_in(connection: ServerConnection, request: Request, dropped: Dropped, taking: set[object]) -> None:
    """Receive one file: its name is in the query, its content is the only message. `taking` has the connections that
    are sending files.
    """
    if not OPERATOR.get():
        await connection.close(_POLICY_VIOLATION, "only a browser on the server's own machine may import files")
        return
    if len(taking) >= MAX_DROPS:
        await connection.close(_TRY_AGAIN_LATER, f"at most {MAX_DROPS} files at a time")
        return
    name = parse_qs(urlsplit(request.path).query).get("name", ["mesh"])[0]
    taking.add(connection)
    try:
        with contextlib.suppress(ConnectionClosed, TimeoutError):
            content = await asyncio.wait_for(connection.recv(decode=False), DROP_S)
            await connection.send(await asyncio.to_thread(dropped, name, content))
    finally:
        taking.remove(connection)
