"""The control client on a real server, with and without keys, and on servers that do not answer."""

import json
import socket
import sys

import pytest
import zmq
from languages import run
from live_server import serving
from manipnet_client import ControlClient, RequestError

from manipnet import __version__
from manipnet.net.curve_keys import make_client_keys, make_server_keys, read_server_keys
from manipnet.synthesis.objects.library import LIBRARY_FOLDER


@pytest.fixture(scope="module")
def server(tiny_bundle, tmp_path_factory):
    """A server that can record, with a cube on the body Box."""
    options = ("--mesh", f"Box={LIBRARY_FOLDER / 'cube.ply'}", "--model", str(tiny_bundle))
    with serving(*options, "--takes", str(tmp_path_factory.mktemp("takes"))) as server:
        yield server


@pytest.fixture
def control(server):
    return ControlClient(server.addresses["control"])


def test_reads_version_and_status(control):
    assert control.ask("hello")["version"] == __version__
    assert control.ask("status")["counters"]["control_requests"]["hello"] >= 1


def test_changes_objects_look_ahead_and_pause(control):
    assert control.ask("select_object", body="Box", object="mug", scale=1.5)["object"] == "mug"
    assert control.ask("objects")["bodies"]["actor"]["Box"]["scale"] == 1.5
    assert control.ask("look_ahead", seconds=0.2) == {"seconds": 0.2}
    assert control.ask("pause") == {"actors": ["actor"], "paused": True}
    assert control.ask("pause", on=False)["paused"] is False


def test_records(control):
    name = control.ask("record", name="take")["name"]
    assert control.ask("recordings")["recording"]["name"] == name
    assert control.ask("stop_recording")["name"] == name
    assert name in control.ask("recordings")["recordings"]


def test_sends_and_receives_long_frames(control):
    mesh = control.ask("mesh", body="Box")
    assert len(mesh["vertices"]) > 256
    with pytest.raises(RequestError, match="mug"):
        control.ask("select_object", body="Box", object=1000 * "x")


@pytest.mark.parametrize("request_", [{"op": "look_ahead", "seconds": 9}, {"op": "dance"}])
def test_a_refusal_has_the_text_of_the_server(server, control, request_):
    text = server.ask(request_)["error"]
    with pytest.raises(RequestError) as refusal:
        control.ask(**request_)
    assert str(refusal.value) == text


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    """The folder of keys of a server and of its client."""
    folder = tmp_path_factory.mktemp("keys")
    make_server_keys(folder)
    make_client_keys(folder, "listed")
    return folder


def test_keys_open_a_server_that_requires_them(tiny_bundle, keys, tmp_path):
    make_server_keys(tmp_path)
    make_client_keys(tmp_path, "stranger")
    with serving("--model", str(tiny_bundle), "--keys", str(keys)) as server:
        address = server.addresses["control"]
        assert ControlClient(address, keys=keys / "listed.toml").ask("hello")["version"] == __version__
        with pytest.raises(RequestError, match="seconds"):
            ControlClient(address, keys=keys / "listed.toml").ask("look_ahead")
        with pytest.raises(ConnectionError, match="the server refused this client"):
            ControlClient(address, keys=tmp_path / "stranger.toml").ask("hello")
        with pytest.raises(ConnectionError, match="the server requires CURVE; pass `keys`"):
            ControlClient(address).ask("hello")


def test_nobody_listens():
    with socket.create_server(("127.0.0.1", 0)) as free:
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(ConnectionError, match=f"cannot send 'hello' to {address}"):
        ControlClient(address).ask("hello")


@pytest.mark.parametrize("secure", [False, True])
def test_a_server_that_does_not_answer(keys, secure):
    with zmq.Context() as context, context.socket(zmq.REP) as rep:
        rep.setsockopt(zmq.LINGER, 0)
        if secure:
            rep.curve_server = True
            rep.curve_secretkey = read_server_keys(keys).pair.secret.encode()
        port = rep.bind_to_random_port("tcp://127.0.0.1")
        options = {"keys": keys / "listed.toml"} if secure else {}
        client = ControlClient(f"tcp://127.0.0.1:{port}", timeout_s=0.5, **options)
        with pytest.raises(TimeoutError, match=r"did not answer 'status' within 0.5 s"):
            client.ask("status")
        assert rep.recv(zmq.NOBLOCK) == b'{"op": "status"}'


def test_a_server_that_is_silent_from_the_start():
    with socket.create_server(("127.0.0.1", 0)) as mute:
        client = ControlClient(f"tcp://127.0.0.1:{mute.getsockname()[1]}", timeout_s=0.2)
        with pytest.raises(TimeoutError, match="did not answer"):
            client.ask("status")


@pytest.mark.parametrize("address", ["127.0.0.1:5557", "tcp://host:0"])
def test_a_wrong_address_is_refused_at_once(address):
    with pytest.raises(ValueError, match="tcp://HOST:PORT"):
        ControlClient(address)


def test_only_keys_need_pyzmq(control, keys, monkeypatch):
    monkeypatch.setitem(sys.modules, "zmq", None)
    monkeypatch.delitem(sys.modules, "manipnet_client.curve", raising=False)
    assert control.ask("hello")["version"] == __version__
    with pytest.raises(ImportError, match=r"pip install .*curve"):
        ControlClient("tcp://127.0.0.1:5557", keys=keys / "listed.toml")


def test_requests_as_methods(control):
    assert 0.0 < control.look_ahead(0.2) <= 0.5
    name = control.record("by the client")
    assert name.startswith("by")
    assert control.stop_recording()["name"] == name
    shape = control.ask("objects")["objects"][0]
    assert control.select_object("Box", shape, 0.9)["scale"] == 0.9
    with pytest.raises(RequestError, match="object"):
        control.select_object("Box", "nothing of this name")


def test_csharp_control_client_does_the_same(server, harness):
    """The client of the Unity package, on a real server."""
    requests = [
        ["hello"],
        ["select_object", "body", "Box", "object", "mug", "scale", "1.25"],
        ["look_ahead", "seconds", "0.3"],
        ["pause", "on", "true"],
        ["pause", "on", "false"],
        ["mesh", "body", "Box"],
        ["dance"],
        ["select_object", "body", "Box", "object", 300 * "x"],
    ]
    lines = run(harness("csharp"), "control", server.addresses["control"], text=_tabbed(requests))
    hello, selected, ahead, paused, running, mesh, *refused = lines
    assert json.loads(hello)["version"] == __version__
    assert json.loads(selected)["scale"] == 1.25
    assert json.loads(ahead) == {"seconds": 0.3}
    assert [json.loads(line)["paused"] for line in (paused, running)] == [True, False]
    assert len(json.loads(mesh)["vertices"]) > 256
    assert all(line.startswith("RequestException") and "allowed" in line for line in refused), refused


def test_csharp_control_client_says_that_nobody_answers(harness):
    (line,) = run(harness("csharp"), "control", "tcp://127.0.0.1:1", text="hello\n")
    assert line == "IOException no server answers at 127.0.0.1:1"


def _tabbed(requests):
    return "".join("\t".join(words) + "\n" for words in requests)
