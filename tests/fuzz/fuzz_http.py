"""Conversations over HTTP and WebSocket that are broken somewhere, as browsers, scanners and worse would have them."""

import base64
import struct
from random import Random
from typing import Final

import msgpack
from fuzz_damage import damaged

METHODS: Final = (
    b"GET",
    b"GET",
    b"GET",
    b"POST",
    b"OPTIONS",
    b"HEAD",
    b"PUT",
    b"CONNECT",
    b"PRI",
    b"get",
    b"",
    b"G\0T",
)
TARGETS: Final = (
    b"/",
    b"/",
    b"/metrics",
    b"/drop?name=mesh.obj",
    b"/drop?name=../../x.obj",
    b"/drop",
    b"/?websocket=ws://evil.test",
    b"/?playbackPath=http://evil.test",
    b"/../../etc/passwd",
    b"/%2e%2e/%2e%2e/etc/passwd",
    b"/%00",
    b"//evil.test/",
    b"http://evil.test/",
    b"*",
    b"",
    b"/" + b"x" * 9000,
    b"/\xff\xfe",
    b"/ /",
)
VERSIONS: Final = (b"HTTP/1.1", b"HTTP/1.1", b"HTTP/1.1", b"HTTP/1.0", b"HTTP/2.0", b"HTTP/9", b"http/1.1", b"")
ORIGINS: Final = (b"http://evil.test", b"null", b"http://localhost:3000", b"http://127.0.0.1.evil.test", b"", b"\xff")
HEADERS: Final = (
    (b"Host", b"evil.test"),
    (b"Host", b"127.0.0.1@evil.test"),
    (b"Host", b"[::1"),
    (b"Origin", b"http://evil.test"),
    (b"Content-Length", b"600"),
    (b"Content-Length", b"-1"),
    (b"Content-Length", b"99999999999999999999"),
    (b"Transfer-Encoding", b"chunked"),
    (b"Expect", b"100-continue"),
    (b"Accept-Encoding", b"gzip, br"),
    (b"Connection", b"keep-alive, Upgrade"),
    (b"Upgrade", b"websocket, h2c"),
    (b"Range", b"bytes=0-,5-1"),
    (b"Cookie", b"x" * 9000),
    (b"X", b"\0"),
    (b"", b""),
    (b" folded", b"x"),
    (b"X" * 9000, b"x"),
    (b"Sec-WebSocket-Version", b"8"),
    (b"Sec-WebSocket-Extensions", b"permessage-deflate; client_max_window_bits=99"),
)
ENDS: Final = (b"\r\n", b"\r\n", b"\r\n", b"\r\n", b"\n", b"\r", b"\r\r\n")
BODIES: Final = (
    b"",
    b"",
    b"\x01" * 600,
    b'{"op": "rest"}',
    b"5\r\nhello\r\n0\r\n\r\n",
    b"fffffffff\r\nx",
    b"\0" * 70_000,
)
TLS_HELLO: Final = b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(range(256)) * 2
HTTP_2: Final = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes(9)
FILES: Final = (
    b"v 0 0 0\nf 1 1 1\n",
    b"ply\nformat ascii 1.0\nelement vertex 2000000000\nend_header\n",
    b"glTF\2\0\0\0",
)
"""Small files that are no good meshes."""


def http_talk(rng: Random, host: bytes, subprotocol: bytes = b"") -> list[bytes]:
    """What a client sends to the port of `host`, one part after another."""
    match rng.randrange(8):
        case 0:
            return [rng.choice((TLS_HELLO, HTTP_2, rng.randbytes(rng.randrange(1, 600))))]
        case 1 | 2 | 3:
            return _web_socket(rng, host, subprotocol)
    request = _request(rng, host, _headers(rng))
    if rng.random() < 0.3:
        return [damaged(rng, [request])]
    if rng.random() < 0.2:
        cuts = sorted(rng.randint(0, len(request)) for _ in range(4))
        return [request[a:b] for a, b in zip([0, *cuts], [*cuts, len(request)], strict=True)]
    return [request] * rng.choice((1, 1, 1, 3))


def _request(rng: Random, host: bytes, headers: list[tuple[bytes, bytes]], target: bytes | None = None) -> bytes:
    end = rng.choice(ENDS)
    target = rng.choice(TARGETS) if target is None else target
    first = b" ".join((rng.choice(METHODS), target, rng.choice(VERSIONS)))
    if rng.random() < 0.8:
        headers = [(b"Host", host), *headers]
    lines = [first, *(name + b": " + value for name, value in headers)]
    return end.join(lines) + end + end + rng.choice(BODIES)


def _headers(rng: Random) -> list[tuple[bytes, bytes]]:
    count = rng.choice((0, 0, 1, 2, 4, 300))
    return [rng.choice(HEADERS) for _ in range(count)]


def _web_socket(rng: Random, host: bytes, subprotocol: bytes) -> list[bytes]:
    """An opening handshake, which is good most of the time, and frames that are broken most of the time."""
    key = base64.b64encode(rng.randbytes(16)) if rng.random() < 0.9 else rng.choice((b"", b"x", b"\xff"))
    headers = [
        (b"Host", host),
        (b"Upgrade", b"websocket"),
        (b"Connection", b"Upgrade"),
        (b"Sec-WebSocket-Key", key),
        (b"Sec-WebSocket-Version", b"13"),
    ]
    if subprotocol and rng.random() < 0.9:
        headers.append((b"Sec-WebSocket-Protocol", subprotocol))
    if rng.random() < 0.2:
        headers.append((b"Origin", rng.choice(ORIGINS)))
    if rng.random() < 0.2:
        headers += _headers(rng)
    target = b"/" if rng.random() < 0.6 else rng.choice(TARGETS[:10])
    opening = b"GET " + target + b" HTTP/1.1\r\n" + b"".join(name + b": " + value + b"\r\n" for name, value in headers)
    return [opening + b"\r\n", *(_frame(rng) for _ in range(rng.randrange(8)))]


def _frame(rng: Random) -> bytes:
    content = _message(rng)
    first = rng.choice((0x80, 0x80, 0x80, 0x00, 0xF0)) | rng.choice((0, 1, 2, 2, 2, 2, 3, 8, 9, 10, 15))
    length = len(content) if rng.random() < 0.9 else rng.choice((0, 125, 126, 2**16, 2**31, 2**63, 2**64 - 1))
    masked = 0x80 if rng.random() < 0.95 else 0
    if length < 126:
        head = bytes([first, masked | length])
    elif length < 2**16:
        head = bytes([first, masked | 126]) + struct.pack(">H", length)
    else:
        head = bytes([first, masked | 127]) + struct.pack(">Q", length)
    mask = rng.randbytes(4) if masked else b""
    return head + mask + bytes(byte ^ mask[i % 4] for i, byte in enumerate(content)) if masked else head + content


def _message(rng: Random) -> bytes:
    """The content of a WebSocket frame: what viser's client would send, with something wrong in it, or a file."""
    good: list[bytes] = [
        msgpack.packb({"type": kind, "uuid": "x", "updates": {"value": 1}, "position": [0, 0, 0]}) or b""
        for kind in ("GuiUpdateMessage", "ViewerCameraMessage", "ScenePointerMessage", "FileTransferStartUpload", "?")
    ]
    match rng.randrange(5):
        case 0:
            return rng.randbytes(rng.randrange(200))
        case 1:
            return rng.choice(FILES)
        case 2:
            return rng.choice((struct.pack(">H", rng.choice((1000, 1005, 2999, 65_535))), b"\xff\xfe", b"x" * 200))
        case 3:
            return rng.choice(good)
    return damaged(rng, good)[:2000]
