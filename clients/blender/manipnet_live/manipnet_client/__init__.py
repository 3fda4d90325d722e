"""Receive the fingers of ManipNet Live: `for hands in subscribe("tcp://127.0.0.1:5555"): …`."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator

from .client import Client, Stats
from .interpolation import Interpolator, Shown
from .message import Body, Hand, Hands, MessageError, decode
from .zmtp import parse_address

__all__ = [
    "Body",
    "Client",
    "Hand",
    "Hands",
    "Interpolator",
    "MessageError",
    "Shown",
    "Stats",
    "decode",
    "subscribe",
    "subscribe_async",
]


def subscribe(address: str, actor: str | None = None) -> Iterator[Hands]:
    """The newest hands, again and again, for as long as you iterate. Slow consumers skip frames, never lag.

    Waits while there is no server. Raises `ValueError` for an address that is not `tcp://host:port`.
    """
    parse_address(address)
    return _iterate(address, actor)


def _iterate(address: str, actor: str | None) -> Iterator[Hands]:
    with Client(address, actor) as client:
        hands = None
        while True:
            fresh = client.wait(after=hands, timeout_s=0.5)
            if fresh is not None:
                hands = fresh
                yield hands


async def subscribe_async(address: str, actor: str | None = None) -> AsyncIterator[Hands]:
    """As `subscribe`, for `async for`."""
    client = Client(address, actor)
    hands = None
    try:
        while True:
            fresh = await asyncio.to_thread(client.wait, hands, 0.5)
            if fresh is not None:
                hands = fresh
                yield hands
    finally:
        await asyncio.to_thread(client.close)
