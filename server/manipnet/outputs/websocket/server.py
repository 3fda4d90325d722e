"""Publishes hands over WebSocket: each binary message is one `pose/bin` payload, and a slow client skips messages."""

import asyncio
import contextlib
import re
import threading
from collections import deque
from collections.abc import Sequence
from http import HTTPStatus

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Origin, Subprotocol

from manipnet.net.errors import cannot_listen
from manipnet.net.half_open import BACKLOG, HalfOpen, handshake_log
from manipnet.outputs.declaration import EncodedHands, HandsOutput
from manipnet.outputs.websocket.token import SUBPROTOCOL, shows_token
from manipnet.telemetry import Telemetry

MAX_CLIENTS = 32
QUEUE_LENGTH = 8
"""Payloads that wait for a client, about an eighth of a second of hands; beyond it, the oldest are dropped."""

MAX_REQUEST_BYTES, MAX_REQUESTS = 1024, 16
"""Clients have no reason to send anything."""

OPEN_S = 5.0
"""A client that has not completed the handshake after this time is cut off."""

LOCAL_PAGES = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")
"""The origins of pages that may connect. Other web sites in the same browser may not. Programs send none."""

_POLICY_VIOLATION, _TRY_AGAIN_LATER = 1008, 1013


class WebSocketPublisher(HandsOutput):
    """Serves on a thread of its own, from its creation until `close`."""

    def __init__(self, telemetry: Telemetry, host: str, port: int, token: str | None = None) -> None:
        """Bind the port, of which 0 takes any free one. Raises `ListenError`.

        With a `token`, pages of every origin may connect, and every page and program must show it.
        """
        self._telemetry, self._token = telemetry, token
        self._clients: dict[asyncio.Event, deque[bytes]] = {}
        self._loop = asyncio.new_event_loop()
        try:
            self._server = self._loop.run_until_complete(self._serve(host, port))
        except BaseException as error:
            self._loop.close()
            if isinstance(error, OSError):
                raise cannot_listen(f"ws://{host}:{port}", error.strerror or error) from None
            raise
        port = self._server.sockets[0].getsockname()[1]
        self.address = f"ws://[{host}]:{port}" if ":" in host else f"ws://{host}:{port}"
        self._thread = threading.Thread(target=self._loop.run_forever, name="websocket-out", daemon=True)
        self._thread.start()

    def connected(self) -> int:
        """The number of clients that are connected. From any thread."""
        return len(self._clients)

    def send(self, hands: EncodedHands) -> bool:
        """Offer one message to every client."""
        return self.publish(hands.binary)

    def publish(self, payload: bytes) -> bool:
        """Offer one payload to every client and return at once; False if there is none. From any thread."""
        if not self._clients:
            return False
        with contextlib.suppress(RuntimeError):  # the loop is closed, since the server is stopping
            self._loop.call_soon_threadsafe(self._offer, payload)
        return True

    def close(self) -> None:
        """Close all connections and end the thread. Does nothing the second time."""
        if self._loop.is_closed():
            return
        asyncio.run_coroutine_threadsafe(self._close(), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _serve(self, host: str, port: int):
        origins: list[Origin | re.Pattern[str] | None] | None = [None, LOCAL_PAGES] if self._token is None else None
        return await serve(
            self._feed,
            host,
            port,
            origins=origins,
            select_subprotocol=_subprotocol,
            process_request=self._check,
            compression=None,
            max_size=MAX_REQUEST_BYTES,
            close_timeout=1,
            open_timeout=OPEN_S,
            backlog=BACKLOG,
            create_connection=HalfOpen(lambda: self._refuse("too_many")).connection,
            logger=handshake_log(__name__),
        )

    def _check(self, connection: ServerConnection, request: Request) -> Response | None:
        if self._token is None or shows_token(request.headers, self._token):
            return None
        self._refuse("token")
        return connection.respond(HTTPStatus.UNAUTHORIZED, "This server asks for its token (--web-token).\n")

    async def _close(self) -> None:
        self._server.close()
        await self._server.wait_closed()

    def _offer(self, payload: bytes) -> None:
        for news, queue in self._clients.items():
            queue.append(payload)
            news.set()

    async def _feed(self, connection: ServerConnection) -> None:
        """Send what waits for a client, one payload after another as it takes them."""
        if len(self._clients) >= MAX_CLIENTS:
            self._refuse("too_many")
            await connection.close(_TRY_AGAIN_LATER, f"at most {MAX_CLIENTS} clients")
            return
        news = asyncio.Event()
        queue = self._clients[news] = deque[bytes](maxlen=QUEUE_LENGTH)
        reading = asyncio.create_task(self._ignore(connection, news))
        try:
            while not reading.done():
                await news.wait()
                news.clear()
                while queue:
                    await connection.send(queue.popleft())
        except ConnectionClosed:
            pass
        finally:
            del self._clients[news]
            reading.cancel()

    async def _ignore(self, connection: ServerConnection, news: asyncio.Event) -> None:
        """Ignore what a client sends, but notice the end of its connection. Cut off a client that goes on sending."""
        with contextlib.suppress(ConnectionClosed):
            for _ in range(MAX_REQUESTS):
                await connection.recv()
            self._refuse("endless")
            await connection.close(_POLICY_VIOLATION, "clients must not send anything")
        news.set()

    def _refuse(self, reason: str) -> None:
        self._telemetry.count("connections_refused", reason=reason)


def _subprotocol(_: ServerConnection, offered: Sequence[Subprotocol]) -> Subprotocol | None:
    """Ours, if the client names it. Older clients name none."""
    return Subprotocol(SUBPROTOCOL) if SUBPROTOCOL in offered else None
