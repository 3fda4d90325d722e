"""Hands out to browsers: each binary WebSocket message is one `pose/bin` payload, a slow reader skips."""

import asyncio
import contextlib
import re
import threading
from collections import deque

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.typing import Origin

from manipnet.telemetry import Telemetry

MAX_CLIENTS = 32
QUEUE_LENGTH = 8
"""Payloads a client may be behind, an eighth of a second; then the oldest go."""

MAX_REQUEST_BYTES, MAX_REQUESTS = 1024, 16
"""Clients have nothing to say."""

LOCAL_PAGES = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")
"""Pages that may connect; any other web site open in the same browser may not watch. Programs send no origin."""

_POLICY_VIOLATION, _TRY_AGAIN_LATER = 1008, 1013


class WebSocketPublisher:
    """Serves on its own thread from construction to `stop`. A client that reads slowly skips messages.

    Raises `OSError` when the address cannot be bound.
    """

    def __init__(self, host: str, port: int, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._clients: dict[asyncio.Event, deque[bytes]] = {}
        self._loop = asyncio.new_event_loop()
        try:
            self._server = self._loop.run_until_complete(self._serve(host, port))
        except BaseException:
            self._loop.close()
            raise
        port = self._server.sockets[0].getsockname()[1]
        self.address = f"ws://[{host}]:{port}" if ":" in host else f"ws://{host}:{port}"
        self._thread = threading.Thread(target=self._loop.run_forever, name="websocket-out", daemon=True)
        self._thread.start()

    @property
    def client_count(self) -> int:
        """How many clients are connected."""
        return len(self._clients)

    def publish(self, payload: bytes) -> None:
        """Offer a payload to every client; returns at once, from any thread."""
        with contextlib.suppress(RuntimeError):  # the loop is closed: stopping
            self._loop.call_soon_threadsafe(self._offer, payload)

    def stop(self) -> None:
        """Close all connections and the thread."""
        if self._loop.is_closed():
            return
        asyncio.run_coroutine_threadsafe(self._close(), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _serve(self, host: str, port: int):
        origins: list[Origin | re.Pattern[str] | None] = [None, LOCAL_PAGES]
        return await serve(
            self._feed, host, port, origins=origins, compression=None, max_size=MAX_REQUEST_BYTES, close_timeout=1
        )

    async def _close(self) -> None:
        self._server.close()
        await self._server.wait_closed()

    def _offer(self, payload: bytes) -> None:
        for news, queue in self._clients.items():
            queue.append(payload)
            news.set()

    async def _feed(self, connection: ServerConnection) -> None:
        """Send what has come whenever the client has taken the last."""
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
        """Read and forget, so that a connection closed while nothing is published does not linger; end a chatter."""
        with contextlib.suppress(ConnectionClosed):
            for _ in range(MAX_REQUESTS):
                await connection.recv()
            self._refuse("endless")
            await connection.close(_POLICY_VIOLATION, "nothing is to be said here")
        news.set()

    def _refuse(self, reason: str) -> None:
        self._telemetry.count("connections_refused", reason=reason)
