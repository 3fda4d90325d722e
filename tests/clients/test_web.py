"""The web client in a real browser: the example page on a live server that is killed and started again."""

import shutil

import pytest
from browser import browsing, serving
from checkout import CLIENTS, ROOT, need, publishing

CDN = "https://cdn.jsdelivr.net/npm/three@0.170.0"
STUB = ROOT / "tests" / "clients" / "web" / "three-stub.js"


@pytest.fixture
def pages(tmp_path):
    """Serves the web client's folder with a stub in place of three.js, so that tests need no network."""
    folder = tmp_path / "web"
    shutil.copytree(CLIENTS / "web", folder)
    for path in ("three/build/three.module.js", "three/examples/jsm/controls/OrbitControls.js"):
        (folder / path).parent.mkdir(parents=True)
        shutil.copy(STUB, folder / path)
    with serving(folder, {CDN: "/three"}) as address:
        yield address


def test_example_page_reconnects_to_a_restarted_server(pages, tmp_path):
    (chromium,) = need("chromium")
    status = "document.getElementById('status').textContent"
    with publishing("--session", "a") as (process, _, websocket):
        url = f"{pages}/example.html?server={websocket}"
        with browsing(chromium, url, tmp_path / "profile") as page:
            text = page.wait_for(f"{status}.includes(' 0 lost') && {status}")
            assert text.startswith("connected")
            assert "left: live, cube" in text
            page.wait_for("Number(document.body.dataset.frames) > 10")
            process.kill()
            process.wait()
            page.wait_for(f"{status}.startsWith('reconnecting')")
            port = websocket.rpartition(":")[2]
            with publishing("--session", "b", "--websocket-port", port):
                page.wait_for(f"{status}.startsWith('connected')")


def test_joint_names_are_webxr_names():
    from manipnet.wire.hand_names import WEBXR_JOINT_NAMES

    text = (CLIENTS / "web" / "layout.js").read_text(encoding="utf-8")
    for name in WEBXR_JOINT_NAMES:
        assert f'"{name}"' in text
