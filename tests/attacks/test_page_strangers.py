"""The page in a real browser, against links, names and frames of strangers: none of their code runs."""

import html
import http.client
import json
import shutil
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from browser import Page, browsing
from browser import serving as serving_files
from live_server import LiveServer, Sender, scene, serving
from websockets.sync.server import ServerConnection, serve

from manipnet.page import panel
from manipnet.page.markdown import escape

BROWSER_S = 240.0
FRAME = '<iframe srcdoc="<script>parent.hit=1</script>">'
PICTURE = '<img src=x onerror="window.hit=1">'
LINK = "[click](javascript:window.hit=1)"
NAMES = (FRAME, PICTURE, LINK, "<b>bold</b>", "| a | b |", "`code`", "# heading")
TEXT = "document.body.innerText"


@pytest.fixture(scope="module")
def chromium() -> str:
    found = shutil.which("chromium")
    if found is None:
        pytest.skip("needs chromium: apt-get install chromium")
    return found


@pytest.fixture(scope="module")
def server(tiny_bundle: Path) -> Iterator[LiveServer]:
    with serving("--mesh", "Box=cube", "--model", str(tiny_bundle)) as server:
        yield server


def get(address: str, path: str = "/", **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=BROWSER_S)
    connection.request("GET", path, headers=headers)
    response = connection.getresponse()
    response.read()
    connection.close()
    return response


def test_the_page_comes_with_a_strict_policy(server: LiveServer) -> None:
    response = get(server.addresses["page"])
    policy = {
        part.split()[0]: part.split()[1:] for part in (response.getheader("Content-Security-Policy") or "").split(";")
    }
    host = urlsplit(server.addresses["page"]).netloc
    assert policy["default-src"] == ["'none'"]
    assert policy["frame-ancestors"] == ["'none'"]
    assert set(policy["connect-src"]) <= {"'self'", f"ws://{host}", "data:", "blob:"}
    assert "'unsafe-eval'" not in policy["script-src"]
    assert "'unsafe-inline'" not in policy["script-src"]
    assert response.getheader("X-Frame-Options") == "DENY"


@pytest.mark.parametrize(
    "query", ["websocket=ws://127.0.0.1:9", "a=b&websocket=ws%3A%2F%2Fevil.test", "playbackPath=http://evil.test/x"]
)
def test_an_address_that_redirects_the_client_is_refused(server: LiveServer, query: str) -> None:
    assert get(server.addresses["page"], f"/?{query}").status == 400


def test_a_page_of_another_port_of_this_machine_is_a_stranger(server: LiveServer) -> None:
    address = server.addresses["page"]
    port = urlsplit(address).port
    assert get(address, Origin=f"http://localhost:{port}", Host=f"localhost:{port}").status == 200
    assert get(address, Origin="http://localhost:3000").status == 403
    assert get(address, Origin="http://127.0.0.1:1").status == 403


def test_a_link_with_a_foreign_socket_connects_nowhere(server: LiveServer, chromium: str, tmp_path: Path) -> None:
    visited = threading.Event()

    def meet(_: ServerConnection) -> None:
        visited.set()

    with serve(meet, "127.0.0.1", 0) as stranger:
        threading.Thread(target=stranger.serve_forever, daemon=True).start()
        port = stranger.socket.getsockname()[1]
        with browsing(chromium, f"{server.addresses['page']}/?websocket=ws://127.0.0.1:{port}", tmp_path) as page:
            page.wait_for("document.readyState === 'complete'", BROWSER_S)
            assert not visited.wait(5.0)
        stranger.shutdown()


def test_names_are_shown_as_text_and_run_nothing(tiny_bundle: Path, chromium: str, tmp_path: Path) -> None:
    with serving("--mesh", "Box=cube", "--model", str(tiny_bundle)) as server:
        for name in NAMES:
            server.ask({"op": "select_object", "body": name, "object": "cube"})
        with browsing(chromium, server.addresses["page"], tmp_path) as page:
            sender = Sender(server.addresses["bodies"])
            try:
                for i in range(240):
                    bodies = {**scene(i / 120.0), **{name: (0.2, 1.0, 0.1, 0.0, 0.0, 0.0, 1.0) for name in NAMES}}
                    sender.send(10.0 + i / 120.0, bodies)
                for name in NAMES:
                    page.wait_for(f"{TEXT}.includes({json.dumps(name)})", BROWSER_S)
                assert page.evaluate("window.hit === undefined && document.querySelector('iframe') === null")
            finally:
                sender.close()


def open_tab(page: Page, name: str, shown: str) -> None:
    """Click a tab until one of its fields is shown: a panel that is still being laid out moves away from a click."""
    page.wait_for(f"{TEXT}.includes('Waiting for bodies')", BROWSER_S)
    give_up_s = time.monotonic() + BROWSER_S
    while not page.evaluate(f"[...document.querySelectorAll('input')].some(one => {shown})"):
        assert time.monotonic() < give_up_s, f"the tab {name} does not open"
        page.click(name, BROWSER_S)


def test_names_of_files_and_errors_about_them_run_nothing(tiny_bundle: Path, chromium: str, tmp_path: Path) -> None:
    takes, objects = tmp_path / "takes", tmp_path / "objects"
    for folder in (takes, objects):
        folder.mkdir()
        for name in (PICTURE, LINK):
            (folder / f"{name}{'.mcap' if folder is takes else '.stl'}").write_bytes(b"neither a take nor a mesh")
    options = ("--mesh", "Box=cube", "--model", str(tiny_bundle), "--takes", str(takes), "--objects", str(objects))
    with serving(*options) as server, browsing(chromium, server.addresses["page"], tmp_path / "profile") as page:
        open_tab(page, "Takes", "one.value.endsWith('.mcap')")
        page.choose("Take", f"{PICTURE}.mcap")
        page.click("Show this take")
        page.wait_for(f"{TEXT}.includes('not a recording')", BROWSER_S)
        open_tab(page, "Objects", "one.value === 'Box'")
        page.choose("Object", PICTURE)
        page.wait_for(f"{TEXT}.includes({json.dumps(f'{PICTURE}.stl')})", BROWSER_S)
        assert page.evaluate("window.hit === undefined && document.querySelector('img[onerror]') === null")


def test_no_frame_of_a_foreign_page_shows_it(server: LiveServer, chromium: str, tmp_path: Path) -> None:
    folder = tmp_path / "evil"
    folder.mkdir()
    (folder / "index.html").write_text(f'<iframe id="it" src="{server.addresses["page"]}"></iframe>')
    with (
        serving_files(folder) as address,
        browsing(chromium, f"{address}/index.html", tmp_path / "profile") as page,
    ):
        page.wait_for("document.readyState === 'complete'", BROWSER_S)
        # A refused frame shows the browser's own error page, which is of no origin a script may read.
        page.wait_for("document.getElementById('it').contentDocument === null", BROWSER_S)
        frames = page.call("Page.getFrameTree")["frameTree"].get("childFrames", [])
        assert all(
            frame["frame"]["url"].startswith("chrome-error:") or frame["frame"].get("unreachableUrl")
            for frame in frames
        )


@pytest.mark.parametrize("name", NAMES)
def test_a_name_becomes_references_that_show_it_and_nothing_else(name: str) -> None:
    escaped = escape(name)
    assert html.unescape(escaped) == name
    assert not set("<>[]|`*_\\") & set(escaped)


def test_the_headline_warns_of_what_is_down_and_of_an_open_server() -> None:
    status = {
        "exposed": True,
        "receivers": {
            "zmq": {"state": "down", "restarts": 1, "error": f"ListenError: {FRAME}"},
            "osc": {"state": "listening", "restarts": 3, "error": "OSError: gone"},
        },
    }
    down, exposed = panel._warnings(status)
    assert "zmq is down" in down
    assert "<" not in down
    assert "Open to every machine" in exposed
    assert panel._warnings({"receivers": {}, "exposed": False}) == []
