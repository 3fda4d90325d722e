"""The web client in a real browser: the example page on a live server that is killed and started again."""

import shutil

import pytest
from browser import browsing, serving
from checkout import CLIENTS, ROOT, need, publishing
from npm import run_node

CDN = "https://cdn.jsdelivr.net/npm/three@0.170.0"
STUB = ROOT / "tests" / "clients" / "web" / "three-stub.js"


@pytest.fixture
def pages(tmp_path):
    """Serves the web client's folder with a stub in place of three.js, so that tests need no network."""
    folder = tmp_path / "web"
    shutil.copytree(CLIENTS / "web", folder)
    for path in (
        "three/build/three.module.js",
        "three/examples/jsm/controls/OrbitControls.js",
        "three/examples/jsm/loaders/GLTFLoader.js",
        "three/examples/jsm/loaders/OBJLoader.js",
        "three/examples/jsm/webxr/VRButton.js",
    ):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
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


def test_example_page_shows_the_token_of_its_address(pages, tmp_path):
    (chromium,) = need("chromium")
    status = "document.getElementById('status').textContent"
    with publishing("--token", "token-of-the-stage-12") as (_, _, websocket):
        url = f"{pages}/example.html?server={websocket}"
        with browsing(chromium, url, tmp_path / "without") as page:
            page.wait_for(f"{status}.includes('reconnecting')")
        with browsing(chromium, f"{url}#token=token-of-the-stage-12", tmp_path / "with") as page:
            page.wait_for(f"{status}.startsWith('connected')")


def test_only_a_page_with_a_headset_has_the_button_to_enter_vr(pages, tmp_path):
    (chromium,) = need("chromium")
    buttons = "document.querySelectorAll('button').length"
    with browsing(chromium, f"{pages}/example.html?server=ws://127.0.0.1:1", tmp_path / "profile") as page:
        page.wait_for("Number(document.body.dataset.frames) > 10")
        assert page.evaluate(buttons) == 0
        page.call("Page.enable")
        with_headset = "navigator.xr.isSessionSupported = async (mode) => mode === 'immersive-vr'"
        page.call("Page.addScriptToEvaluateOnNewDocument", source=with_headset)
        page.call("Page.reload")
        page.wait_for(f"{buttons} === 1")


PACKED = """
const { execFileSync } = require("child_process");
const { mkdtempSync, writeFileSync } = require("fs");
const path = require("path");
const [client, address, modules] = process.argv.slice(1);
const project = mkdtempSync(path.join(require("os").tmpdir(), "manipnet-project-"));
const npm = (...words) => execFileSync("npm", [...words, "--silent", "--no-audit", "--no-fund"], { cwd: project });
const packed = JSON.parse(npm("pack", client, "--json"))[0];
writeFileSync(path.join(project, "package.json"), '{ "type": "module" }');
npm("install", "./" + packed.filename);
writeFileSync(path.join(project, "use.ts"), `
  import { AvatarHands, ManipNetClient, JOINT_NAMES, type HandProfile, type HandsFrame } from "manipnet-client";
  import { WebSocket } from "ws";
  const client = new ManipNetClient("${address}", { WebSocket: WebSocket as any, delayS: 0.05, token: null });
  const bare = { name: "none", traverse() {}, updateWorldMatrix() {} };
  let refused = "";
  try {
    const profile: HandProfile = new AvatarHands(bare, { side: "left" }).profile;
  } catch (error: any) {
    refused = error.message;
  }
  const timer = setInterval(() => {
    if (!client.sample() || client.stats().received < 10) return;
    const hands: HandsFrame = client.hands;
    const x: number = hands.left.joints[0];
    const { state } = client.stats();
    console.log(JSON.stringify({ joints: JOINT_NAMES.length, left: hands.left.present, state, x, refused }));
    clearInterval(timer);
    client.close();
  }, 20);
`);
const tsc = path.join(process.cwd(), "node_modules/typescript/bin/tsc");
require("fs").symlinkSync(path.join(process.cwd(), "node_modules/ws"), path.join(project, "node_modules/ws"));
require("fs").mkdirSync(path.join(project, "node_modules/@types"), { recursive: true });
for (const each of ["@types/ws", "@types/node"]) {
  require("fs").symlinkSync(path.join(process.cwd(), "node_modules", each), path.join(project, "node_modules", each));
}
try {
  const options = ["--strict", "--module", "nodenext", "--target", "es2022", "--types", "node", "--skipLibCheck"];
  execFileSync("node", [tsc, ...options, "use.ts"], { cwd: project });
} catch (error) {
  throw new Error(error.stdout.toString());
}
const out = execFileSync("node", ["use.js"], { cwd: project, timeout: 60000 }).toString();
console.log(JSON.stringify({ files: packed.files.map((each) => each.path), out: JSON.parse(out) }));
"""


def test_the_packed_client_is_typed_and_runs_in_node_with_a_given_websocket():
    packages = ("typescript@5.6.3", "ws@8.18.0", "@types/ws@8.5.13", "@types/node@20.17.10")
    with publishing() as (_, _, websocket):
        result = run_node(PACKED, str(CLIENTS / "web"), websocket, packages=packages)
    files = {"manipnet.js", "avatar.js", "rig-names.js", "manipnet.d.ts", "README.md", "example.html"}
    assert files <= set(result["files"])
    shown = {key: result["out"][key] for key in ("joints", "left", "state")}
    assert shown == {"joints": 26, "left": True, "state": "connected"}
    assert "bone map" in result["out"]["refused"]


def test_joint_names_are_webxr_names():
    from manipnet.wire.hand_names import WEBXR_JOINT_NAMES

    text = (CLIENTS / "web" / "layout.js").read_text(encoding="utf-8")
    for name in WEBXR_JOINT_NAMES:
        assert f'"{name}"' in text
