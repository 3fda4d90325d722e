"""One WebSocket client: what it receives, and the requests that it may send."""

import asyncio
import contextlib
from collections import deque
from typing import Final
from urllib.parse import unquote

from manipnet.outputs.declaration import Submit

QUEUE_LENGTH: Final = 8
"""Payloads that wait for a client, about an eighth of a second of hands; beyond it, the oldest are dropped."""
MAX_REQUESTS: Final = 16
"""Requests of one client within `MINUTE_S`; a client that sends more is cut off."""
MINUTE_S: Final = 60.0
AVATAR_PATH: Final = "/hand/"
NOT_JSON: Final = '{"error": "a request over WebSocket must be a text message with a JSON map, as {\\"op\\": …}"}'


def avatar_of(path: str) -> str | None:
    """The name of the avatar whose hands are published at the path of an address; None for the model's hand."""
    path = path.partition("?")[0]
    return unquote(path.removeprefix(AVATAR_PATH)) if path.startswith(AVATAR_PATH) else None


class Client:
    """The payloads that wait for one client, and its count of requests. Belongs to the thread of the server."""

    def __init__(self, avatar: str | None) -> None:
        """`avatar` is the name of the avatar whose hands it receives; None for the model's hand."""
        self.avatar = avatar
        self._news = asyncio.Event()
        self._payloads: deque[bytes] = deque(maxlen=QUEUE_LENGTH)
        self._requests: deque[float] = deque(maxlen=MAX_REQUESTS)

    def offer(self, payload: bytes) -> None:
        """Let a payload wait for the client, in place of the oldest one if too many do."""
        self._payloads.append(payload)
        self._news.set()

    def wake(self) -> None:
        """Let `wait` return, although there may be no payload."""
        self._news.set()

    async def wait(self) -> None:
        """Wait until there are payloads, or `wake` is called."""
        await self._news.wait()
        self._news.clear()

    def next_payload(self) -> bytes | None:
        """The oldest payload that waits, which waits no longer; None if there is none."""
        return self._payloads.popleft() if self._payloads else None

    def may_ask(self, now_s: float) -> bool:
        """Note a request at `now_s`; False if the client has sent `MAX_REQUESTS` others within the last minute."""
        too_many = len(self._requests) == MAX_REQUESTS and now_s - self._requests[0] < MINUTE_S
        self._requests.append(now_s)
        return not too_many


async def answer_to(message: str | bytes, submit: Submit) -> str:
    """The answer of the server to a request, as JSON."""
    request = message.encode().lstrip() if isinstance(message, str) else b""
    if not request.startswith(b"{"):
        return NOT_JSON
    loop = asyncio.get_running_loop()
    answer: asyncio.Future[bytes] = loop.create_future()

    def reply(content: bytes) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed, since the server is stopping
            loop.call_soon_threadsafe(lambda: None if answer.done() else answer.set_result(content))

    submit(request, reply)
    return (await answer).decode()
