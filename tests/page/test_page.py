"""The live page: in a real browser, towards strangers, and when its process dies."""

import http.client
import itertools
import os
import shutil
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from browser import browsing
from live_server import LiveServer, Sender, scene, serving

from manipnet.page.web_server import may_act, may_look

FINGERS = "[...document.querySelectorAll('canvas')].length > 0"
TEXT = "document.body.innerText"
PATIENCE_S = 240.0
"""A browser that draws in software, on a busy machine."""


@pytest.fixture(scope="module")
def demo(tiny_bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    takes = tmp_path_factory.mktemp("takes")
    with serving("--demo", "--model", str(tiny_bundle), "--takes", str(takes)) as server:
        yield server


def get(server: LiveServer, **headers: str) -> tuple[int, str]:
    """Status and body of the page's address."""
    host = urlsplit(server.addresses["page"]).netloc
    connection = http.client.HTTPConnection(host, timeout=PATIENCE_S)
    try:
        connection.request("GET", "/", headers=headers)
        response = connection.getresponse()
        return response.status, response.read().decode()
    finally:
        connection.close()


def carried(server: LiveServer) -> dict:
    return server.ask({"op": "objects"})["bodies"]["actor"]


LISTEN = """
window.complaints = [];
addEventListener('error', event => complaints.push(event.message));
console.error = (...words) => complaints.push(words.join(' '));
"""


def test_the_page_shows_hands_swaps_an_object_and_complains_of_nothing(demo: LiveServer, tmp_path: Path) -> None:
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("needs chromium: apt-get install chromium")
    with browsing(chromium, demo.addresses["page"], tmp_path / "profile") as page:
        page.call("Runtime.enable")
        # the first visit starts the page's process and is followed by a load of its own: listen there as well
        page.call("Page.enable")
        page.call("Page.addScriptToEvaluateOnNewDocument", source=LISTEN)
        page.evaluate(LISTEN)
        page.wait_for(f"{TEXT}.includes('hands/s') && document.title === 'ManipNet Live'", PATIENCE_S)
        page.wait_for(f"{FINGERS} && {TEXT}.includes('right_wrist')", PATIENCE_S)
        page.drop("club.ply", Path(__file__).parents[2] / "server/manipnet/synthesis/objects/meshes/hammer.ply")
        page.wait_for("document.getElementById('drop-note').textContent.includes('carries club')", PATIENCE_S)
        assert "club" in {prop["object"] for prop in carried(demo).values()}
        page.drop("nonsense.obj", Path(__file__))
        page.wait_for("document.getElementById('drop-note').textContent.includes('nonsense.obj')", PATIENCE_S)
        assert page.evaluate("window.complaints.join('; ') || 'none'") == "none"
    counters = demo.ask({"op": "status"})["counters"]
    assert counters["page_frames"]["shown"] > 10
    assert "page_ended" not in counters


def test_the_page_says_what_is_wrong_with_what_arrives_and_what_to_do(tiny_bundle: Path, tmp_path: Path) -> None:
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("needs chromium: apt-get install chromium")
    with (
        serving("--mesh", "Box=cube", "--model", str(tiny_bundle)) as server,
        browsing(chromium, server.addresses["page"], tmp_path / "profile") as page,
    ):
        page.wait_for(f"{TEXT}.includes('nothing arrives at all → is the sender running')", PATIENCE_S)
        sender = Sender(server.addresses["bodies"])
        poses = {"left_wrist": scene(0.0)["left_wrist"], "<b>Right</b>": scene(0.0)["right_wrist"]}
        for k in itertools.count():
            sender.send(k / 60, poses)
            if page.evaluate(f"{TEXT}.includes(\"right_wrist: no body 'right_wrist' arrives → give the body\")"):
                break
            assert k < 60 * PATIENCE_S
            time.sleep(1 / 60)
        assert page.evaluate(f"{TEXT}.includes(\"name one of these in the rig: '<b>Right</b>'\")")
        sender.close()


def test_other_web_sites_and_other_names_of_this_machine_are_turned_away(demo: LiveServer) -> None:
    host = urlsplit(demo.addresses["page"]).netloc
    status, body = get(demo)
    assert status == 200
    assert "ManipNet Live" in body
    assert get(demo, Origin=f"http://{host}")[0] == 200
    assert get(demo, Origin="http://elsewhere.example")[0] == 403
    assert get(demo, Host="elsewhere.example")[0] == 403


@pytest.mark.parametrize(
    ("address", "headers", "exposed", "looks", "acts"),
    [
        ("127.0.0.1", {"Host": "127.0.0.1:8080", "Origin": "http://127.0.0.1:8080"}, False, True, True),
        ("127.0.0.1", {"Host": "localhost:9000", "Origin": "http://localhost:9000"}, False, True, True),
        ("127.0.0.1", {"Host": "127.0.0.1:8080", "Origin": "http://evil.example"}, False, False, False),
        ("127.0.0.1", {"Host": "evil.example", "Origin": "http://evil.example"}, False, False, False),
        ("127.0.0.1", {"Host": "evil.example", "Origin": "http://evil.example"}, True, True, False),
        ("10.0.0.7", {"Host": "10.0.0.1:8080", "Origin": "http://10.0.0.1:8080"}, True, True, False),
        ("10.0.0.7", {"Host": "10.0.0.1:8080", "Origin": "http://evil.example"}, True, False, False),
        ("10.0.0.7", {"Host": "127.0.0.1:8080", "Origin": "http://127.0.0.1:8080"}, True, True, False),
        ("::ffff:127.0.0.1", {"Host": "[::1]:8080", "Origin": "http://[::1]:8080"}, False, True, True),
    ],
)
def test_who_may_look_and_who_may_act(address: str, headers: dict, exposed: bool, looks: bool, acts: bool) -> None:
    assert may_look(headers, exposed) == looks
    assert may_act(address, headers) == acts


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the page's process in /proc")
def test_a_page_that_dies_is_counted_and_comes_back_with_the_next_visit(demo: LiveServer) -> None:
    assert get(demo)[0] == 200
    (page,) = [pid for pid in children(demo.process.pid) if b"spawn_main" in command(pid)]
    os.kill(page, signal.SIGKILL)
    while demo.ask({"op": "status"})["counters"].get("page_ended") is None:
        pass
    assert get(demo)[0] == 200
    assert demo.process.poll() is None


def children(pid: int) -> list[int]:
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for task in tasks for child in task.read_text().split()]


def command(pid: int) -> bytes:
    return Path(f"/proc/{pid}/cmdline").read_bytes()
