"""A headless Chromium, asked through its DevTools protocol, and a server for the pages it shows."""

import base64
import functools
import http.server
import io
import itertools
import json
import os
import subprocess
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from websockets.sync.client import connect
from websockets.sync.connection import Connection

_CENTER = """find => (...asked) => {
  const found = find(...asked);
  if (!found) return null;
  found.scrollIntoView({block: "nearest"});
  const {x, y, width, height} = found.getBoundingClientRect();
  const middle = [x + width / 2, y + height / 2];
  const hit = document.elementFromPoint(...middle);
  return hit && (found.contains(hit) || hit.contains(found)) ? middle : null;
}"""
_VISIBLE = "[...document.querySelectorAll(kind)].filter(one => one.offsetParent)"
_BY_TEXT = f"""text => {{
  const says = one => [...one.childNodes].some(node => node.nodeType === 3 && node.textContent.trim() === text);
  const kind = "body *";
  return {_VISIBLE}.filter(says).at(-1);
}}"""
_BY_BEGINNING = _BY_TEXT.replace("trim() === text", "trim().startsWith(text)")
_BY_OPTION = f"""text => {{
  const kind = "[role=option]";
  return {_VISIBLE}.find(one => one.textContent.trim() === text);
}}"""
_BY_LABEL = f"""(text, number) => {{
  const kind = "label";
  let row = {_VISIBLE}.find(one => one.textContent.trim() === text);
  const fields = () => [...row.querySelectorAll("input")].filter(one => one.type !== "hidden");
  while (row && !fields().length) row = row.parentElement;
  return row && fields()[number];
}}"""
"""Where on the page something is, in JavaScript: the middle of what a text, an option or a label leads to.

Null while something else lies over it: a dialog that fades, for example.
"""


class Page:
    """One page of the browser."""

    def __init__(self, connection: Connection, debugger: str = "") -> None:
        """`debugger` is the address of the page's DevTools."""
        self._connection, self._ids, self.debugger = connection, itertools.count(1), debugger

    def call(self, method: str, **params: Any) -> dict:
        """One request of the DevTools protocol, and its answer."""
        number = next(self._ids)
        self._connection.send(json.dumps({"id": number, "method": method, "params": params}))
        while (answer := json.loads(self._connection.recv(timeout=240))).get("id") != number:
            pass
        assert "result" in answer, f"{method}: {answer}"
        return answer["result"]

    def evaluate(self, expression: str) -> Any:
        """The value of a JavaScript expression."""
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def wait_for(self, expression: str, limit_s: float = 30.0) -> Any:
        """Evaluate until it is true."""
        give_up = time.monotonic() + limit_s
        while not (value := self.evaluate(expression)):
            if time.monotonic() > give_up:
                text = self.evaluate("document.body.innerText")
                raise AssertionError(f"never true: {expression}\n{text}")
            time.sleep(0.05)
        return value

    def press(self, place: tuple[float, float], times: int = 1) -> None:
        """Click with the mouse, several times in a row if requested."""
        at = {"x": place[0], "y": place[1], "button": "left"}
        for count in range(1, times + 1):
            for kind in ("mousePressed", "mouseReleased"):
                self.call("Input.dispatchMouseEvent", type=kind, clickCount=count, **at)

    def click(self, text: str, limit_s: float = 30.0, whole: bool = True) -> None:
        """Click the element with exactly this text, or with a text that begins like this, once it exists and stands."""
        find = _BY_TEXT if whole else _BY_BEGINNING
        self.press(self._standing(f"({_CENTER})({find})({json.dumps(text)}, 0)", limit_s))

    def type(self, label: str, text: str, number: int = 0, field: str = "input", enter: bool = True) -> None:
        """Replace what is in one of the fields of a label, and press Enter unless told otherwise."""
        find = _BY_LABEL.replace('"input"', json.dumps(field))
        self.press(self.wait_for(f"({_CENTER})({find})({json.dumps(label)}, {number})"), times=3)
        if text:
            self.call("Input.insertText", text=text)
        else:
            self.key("Backspace")
        if enter:
            self.key("Enter")

    def key(self, key: str) -> None:
        """Press and release a key, named as in `KeyboardEvent.key`."""
        self.keys(key)

    def keys(self, *keys: str) -> None:
        """Press and release keys one after the other, as fast as the browser takes them."""
        for request in [request for key in keys for request in _strokes(key)]:
            self._connection.send(json.dumps({"id": next(self._ids), **request}))
        self.evaluate("0")  # the answers come in order

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Press the mouse at one place, move it in steps to another, and release it there."""
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=start[0], y=start[1])
        self.call("Input.dispatchMouseEvent", type="mousePressed", x=start[0], y=start[1], button="left", clickCount=1)
        for step in range(1, 6):
            x, y = (a + (b - a) * step / 5 for a, b in zip(start, end, strict=True))
            self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button="left", buttons=1)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=end[0], y=end[1], button="left", clickCount=1)

    def tick(self, label: str) -> None:
        """Click the checkbox of a label."""
        self.press(self.wait_for(f"({_CENTER})({_BY_LABEL})({json.dumps(label)}, 0)"))

    def choose(self, label: str, option: str) -> None:
        """Open the list of a label and take one of its options."""
        self.tick(label)
        self.press(self._standing(f"({_CENTER})({_BY_OPTION})({json.dumps(option)}, 0)"))

    def _standing(self, place: str, limit_s: float = 30.0) -> tuple[float, float]:
        """The value of an expression for a place, once it moves no more: lists and dialogs move while they open."""
        now, before = self.wait_for(place, limit_s), None
        while now != before:
            time.sleep(0.05)
            now, before = self.wait_for(place, limit_s), now
        return tuple(now)

    def drop(self, name: str, file: Path) -> None:
        """Drop a file on the page under a name."""
        content = list(file.read_bytes())
        self.evaluate(
            f"""(() => {{
              const carried = new DataTransfer();
              carried.items.add(new File([new Uint8Array({content})], "{name}"));
              dispatchEvent(new DragEvent("drop", {{dataTransfer: carried}}));
            }})()"""
        )

    def give_file(self, file: Path) -> None:
        """Choose a file in the field of the page that takes one."""
        root = self.call("DOM.getDocument")["root"]["nodeId"]
        field = self.call("DOM.querySelector", nodeId=root, selector="input[type=file]")["nodeId"]
        self.call("DOM.setFileInputFiles", nodeId=field, files=[str(file)])

    def picture(self) -> np.ndarray:
        """What the page looks like, `(height, width, 3)`."""
        content = base64.b64decode(self.call("Page.captureScreenshot")["data"])
        return np.asarray(Image.open(io.BytesIO(content)).convert("RGB")).astype(int)

    def screenshot(self, path: Path) -> None:
        """What the page looks like, as PNG."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot")["data"]))


@contextmanager
def serving(folder: Path, replaced: dict[str, str] | None = None) -> Iterator[str]:
    """Serve a folder on loopback; in HTML, texts are replaced."""

    class Handler(http.server.SimpleHTTPRequestHandler):
        def do_GET(self) -> None:
            path = Path(self.translate_path(self.path))
            if path.suffix != ".html":
                super().do_GET()
                return
            text = path.read_text(encoding="utf-8")
            for old, new in (replaced or {}).items():
                text = text.replace(old, new)
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(text.encode())

        def log_message(self, *_: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Handler, directory=folder)) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


@contextmanager
def browsing(chromium: str, url: str, profile: Path) -> Iterator[Page]:
    """A Chromium showing a page."""
    options = ["--headless=new", "--no-sandbox", "--remote-debugging-port=0", f"--user-data-dir={profile}"]
    options += [
        "--no-first-run",
        "--disable-gpu-sandbox",
        "--enable-unsafe-swiftshader",
        "--window-size=1280,720",
        "--force-device-scale-factor=0.5",
    ]
    environment = {**os.environ, "HOME": str(profile)}
    process = subprocess.Popen(
        [chromium, *options, url], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment
    )
    try:
        address = _page_address(profile)
        with connect(address, max_size=None) as connection:
            yield Page(connection, address)
    finally:
        process.terminate()
        process.wait()


@contextmanager
def another(page: Page) -> Iterator[Page]:
    """A second page of the same browser, which shows what the first one shows."""
    devtools = page.debugger.split("/devtools/")[0]
    target = page.call("Target.createTarget", url=page.evaluate("location.href"))["targetId"]
    try:
        with connect(f"{devtools}/devtools/page/{target}", max_size=None) as connection:
            yield Page(connection)
    finally:
        page.call("Target.closeTarget", targetId=target)


def _strokes(key: str) -> list[dict[str, Any]]:
    """The requests that press and release a key."""
    letter = len(key) == 1
    named = {
        " ": ("Space", 32),
        "Backspace": ("Backspace", 8),
        "Enter": ("Enter", 13),
        "Tab": ("Tab", 9),
        "ArrowLeft": ("ArrowLeft", 37),
        "ArrowRight": ("ArrowRight", 39),
    }
    code, number = named.get(key) or (f"Key{key.upper()}", ord(key.upper()))
    about = {"key": key, "code": code, "windowsVirtualKeyCode": number}
    method, typed = "Input.dispatchKeyEvent", {"text": key} if letter else {}
    return [
        {"method": method, "params": {"type": "keyDown", **about, **typed}},
        {"method": method, "params": {"type": "keyUp", **about}},
    ]


def _page_address(profile: Path) -> str:
    """The page's DevTools address, once the browser has written its port."""
    told, give_up = profile / "DevToolsActivePort", time.monotonic() + 30
    while True:
        assert time.monotonic() < give_up, "Chromium did not start"
        time.sleep(0.05)
        if not told.exists() or not (lines := told.read_text().split()):
            continue
        with urllib.request.urlopen(f"http://127.0.0.1:{lines[0]}/json/list") as answer:
            pages = [p for p in json.load(answer) if p["type"] == "page" and p["url"].startswith("http")]
        if pages:
            return pages[0]["webSocketDebuggerUrl"]
