"""What the page allows a browser: scripts and sockets of its own only, and no frame of another page around it.

Viser's client takes the address of its socket from the URL, runs code that arrives there, and renders HTML in Markdown.
The policy protects an operator who follows a link or reads a name that an attacker has made.
Source: Content Security Policy Level 3, https://www.w3.org/TR/CSP3/.
"""

import re
import secrets
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import urlsplit

from websockets.http11 import Request, Response

POLICY: Final = {
    "default-src": "'none'",
    "script-src": "'nonce-{nonce}' 'wasm-unsafe-eval'",
    "style-src": "'unsafe-inline'",
    "img-src": "'self' data: blob:",
    "font-src": "data:",
    "connect-src": "'self' data: blob:",
    "worker-src": "blob: data:",
    "frame-ancestors": "'none'",
    "base-uri": "'none'",
    "form-action": "'none'",
}
"""By directive. Viser writes style attributes and starts a worker from a blob; nothing else is needed."""
_LOADER: Final = ("const d=document.currentScript.dataset;", 'e.type="module";')
"""Where viser's loader looks at its own element, and where it makes the script that it unpacked."""
_ORIGIN = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")


class PolicyError(RuntimeError):
    """The client that viser serves is not the one whose scripts are known, so it cannot be served safely."""


def refusal(request: Request) -> str | None:
    """Why a request for the page itself cannot be met; None if it can.

    The page has no parameters: those of viser's client name a foreign server to obey, or a foreign file to play.
    """
    address = urlsplit(request.path)
    if address.path == "/" and address.query:
        return "This page takes no parameters. Open its address without what follows the question mark.\n"
    return None


def is_own_page(headers: Any) -> bool:
    """Whether a request comes from a page of this very address of this machine, or from no page at all."""
    host, origin = headers.get("Host", ""), headers.get("Origin")
    return _ORIGIN.fullmatch(f"http://{host}") is not None and origin in (None, f"http://{host}")


def protect(response: Response, script: str, style: str) -> None:
    """Put `script` and `style` into a page, and let the browser run it and viser's client, but nothing else.

    Raises `PolicyError`.
    """
    nonce = secrets.token_urlsafe(16)
    page = (response.body or b"").decode("utf-8")
    dataset, module = _LOADER
    if page.count("<script ") != 1 or page.count(dataset) != 1 or page.count(module) != 1:
        raise PolicyError("viser's client has changed; its loader must be looked at before it is served")
    page = page.replace("<script ", f'<script nonce="{nonce}" ', 1)
    page = page.replace(dataset, f"{dataset}const nonce=document.currentScript.nonce;", 1)
    page = page.replace(module, f"{module}e.nonce=nonce;", 1)
    page = page.replace("</body>", f'<style>{style}</style><script nonce="{nonce}">{script}</script></body>', 1)
    response.body = page.encode("utf-8")
    del response.headers["Content-Length"]
    response.headers["Content-Length"] = str(len(response.body))
    policy = "; ".join(f"{directive} {sources}" for directive, sources in POLICY.items())
    response.headers["Content-Security-Policy"] = policy.format(nonce=nonce)
    response.headers["X-Frame-Options"] = "DENY"
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Referrer-Policy"] = "no-referrer"


def is_page(response: Response | None, request: Request) -> bool:
    """Whether a response is the page itself."""
    return response is not None and response.status_code == HTTPStatus.OK and urlsplit(request.path).path == "/"
