"""Publishes hands over WebSocket, and takes hand profiles from the clients; `docs/protocol.md` describes the messages.

The path of the address says which hands a client receives. A slow client skips messages.
"""

import asyncio
import contextlib
import re
import threading
import time
from collections.abc import Sequence
from http import HTTPStatus

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Origin, Subprotocol

from manipnet.net.errors import cannot_listen
from manipnet.net.half_open import BACKLOG, HalfOpen, handshake_log
from manipnet.outputs.declaration import EncodedHands, HandsOutput, Submit, no_requests
from manipnet.outputs.websocket.client import AVATAR_PATH, MAX_REQUESTS, Client, answer_to, avatar_of
from manipnet.outputs.websocket.token import SUBPROTOCOL, shows_token
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.telemetry import Telemetry

MAX_CLIENTS = 32

MAX_REQUEST_BYTES, MAX_REQUESTS_WAITING = 65_536, 2
"""A hand profile with all its digits has 10 000 bytes."""

OPEN_S = 5.0
"""A client that has not completed the handshake after this time is cut off."""

LOCAL_PAGES = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")
"""The origins of pages that may connect. Other web sites in the same browser may not. Programs send none."""

_POLICY_VIOLATION, _TRY_AGAIN_LATER = 1008, 1013


class WebSocketPublisher(HandsOutput):
    """Serves on a thread of its own, from its creation until `close`."""

    def __init__(
        self, telemetry: Telemetry, host: str, port: int, token: str | None = None, submit: Submit = no_requests
    ) -> None:
        """Bind the port, of which 0 takes any free one. Raises `ListenError`.

        With a `token`, pages of every origin may connect, and every page and program must show it. `submit` takes the
        requests of clients.
        """
        self._telemetry, self._token, self._submit = telemetry, token, submit
        self._clients: tuple[Client, ...] = ()
        """Replaced as a whole by the thread of the server, so that other threads can read it."""
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
        return self._has_clients(None) and self.publish(hands.binary)

    def wants(self, avatar: str) -> bool:
        """Whether a client is connected at the path of the avatar. From any thread."""
        return self._has_clients(avatar)

    def send_avatar(self, hands: EncodedHands, profile: HandProfile) -> bool:
        """Offer the hands of an avatar to the clients at its path."""
        if self.wants(profile.name):
            self.publish(hands.binary, profile.name)
        return False

    def _has_clients(self, avatar: str | None) -> bool:
        return any(client.avatar == avatar for client in self._clients)

    def publish(self, payload: bytes, avatar: str | None = None) -> bool:
        """Offer one payload to the clients at the path of an avatar, or without one to those of the model's hand.

        Returns at once, with False if there is no such client. From any thread.
        """
        clients = [client for client in self._clients if client.avatar == avatar]
        if not clients:
            return False
        with contextlib.suppress(RuntimeError):  # the loop is closed, since the server is stopping
            self._loop.call_soon_threadsafe(_offer, payload, clients)
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
            max_queue=MAX_REQUESTS_WAITING,
            close_timeout=1,
            open_timeout=OPEN_S,
            backlog=BACKLOG,
            create_connection=HalfOpen(lambda: self._refuse("too_many")).connection,
            logger=handshake_log(__name__),
        )

    def _check(self, connection: ServerConnection, request: Request) -> Response | None:
        if self._token is not None and not shows_token(request.headers, self._token):
            self._refuse("token")
            return connection.respond(HTTPStatus.UNAUTHORIZED, "This server asks for its token (--web-token).\n")
        if avatar_of(request.path) == "":
            return connection.respond(
                HTTPStatus.NOT_FOUND,
                f"The path is {AVATAR_PATH}; it must be {AVATAR_PATH}NAME, with a profile's name.\n",
            )
        return None

    async def _close(self) -> None:
        self._server.close()
        await self._server.wait_closed()

    async def _feed(self, connection: ServerConnection) -> None:
        """Send what waits for a client, one payload after another as it takes them."""
        assert connection.request is not None  # the handshake is complete
        if len(self._clients) >= MAX_CLIENTS:
            self._refuse("too_many")
            await connection.close(_TRY_AGAIN_LATER, f"at most {MAX_CLIENTS} clients")
            return
        client = Client(avatar_of(connection.request.path))
        self._clients = (*self._clients, client)
        reading = asyncio.create_task(self._answer(connection, client))
        try:
            while not reading.done():
                await client.wait()
                while (payload := client.next_payload()) is not None:
                    await connection.send(payload)
        except ConnectionClosed:
            pass
        finally:
            self._clients = tuple(other for other in self._clients if other is not client)
            reading.cancel()

    async def _answer(self, connection: ServerConnection, client: Client) -> None:
        """Answer the requests of a client until its connection ends. Cut off a client that sends too many."""
        try:
            async for message in connection:
                if not client.may_ask(time.monotonic()):
                    self._refuse("endless")
                    await connection.close(_POLICY_VIOLATION, f"at most {MAX_REQUESTS} requests a minute")
                    break
                await connection.send(await answer_to(message, self._submit))
        except ConnectionClosed:
            pass
        finally:
            client.wake()

    def _refuse(self, reason: str) -> None:
        self._telemetry.count("connections_refused", reason=reason)


def _offer(payload: bytes, clients: Sequence[Client]) -> None:
    for client in clients:
        client.offer(payload)


def _subprotocol(_: ServerConnection, offered: Sequence[Subprotocol]) -> Subprotocol | None:
    """Ours, if the client names it. Older clients name none."""
    return Subprotocol(SUBPROTOCOL) if SUBPROTOCOL in offered else None
