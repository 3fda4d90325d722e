"""Receive hands from ManipNet Live: `for hands in subscribe("tcp://127.0.0.1:5555"): …`."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Generator
from os import PathLike

from .avatar import AvatarError, AvatarHand, RigHand, avatar_profile
from .client import Client, Stats
from .control import ControlClient, RequestError
from .interpolation import Interpolator, Shown
from .message import Body, Hand, Hands, MessageError, decode
from .upload import HandUpload
from .zmtp import parse_address

__version__ = "0.1.0"

__all__ = [
    "AvatarError",
    "AvatarHand",
    "Body",
    "Client",
    "ControlClient",
    "Hand",
    "HandUpload",
    "Hands",
    "Interpolator",
    "MessageError",
    "RequestError",
    "RigHand",
    "Shown",
    "Stats",
    "avatar_profile",
    "decode",
    "subscribe",
    "subscribe_async",
]


def subscribe(
    address: str, actor: str | None = None, keys: str | PathLike[str] | None = None
) -> Generator[Hands, None, None]:
    """Yield the newest hands of `actor` (the first seen, if None), each frame once, until the iteration is closed.

    A slow consumer skips frames and never lags. The iteration waits while there is no server. `keys` is explained at
    `Client`. Raises `ValueError` for an address that is not `tcp://HOST:PORT`.
    """
    parse_address(address)
    return _iterate(address, actor, keys)


def _iterate(address: str, actor: str | None, keys: str | PathLike[str] | None) -> Generator[Hands, None, None]:
    with Client(address, actor, keys=keys) as client:
        hands = None
        while True:
            fresh = client.wait(after=hands, timeout_s=0.5)
            if fresh is not None:
                hands = fresh
                yield hands


async def subscribe_async(
    address: str, actor: str | None = None, keys: str | PathLike[str] | None = None
) -> AsyncGenerator[Hands, None]:
    """`subscribe` for `async for`."""
    client = Client(address, actor, keys=keys)
    hands = None
    try:
        while True:
            fresh = await asyncio.to_thread(client.wait, hands, 0.5)
            if fresh is not None:
                hands = fresh
                yield hands
    finally:
        await asyncio.to_thread(client.close)
