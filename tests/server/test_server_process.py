"""The server as a process: it says when it is ready and why it cannot be, and ends cleanly."""

import signal
import socket
import sys
import urllib.request
from pathlib import Path

import pytest
import zmq
from live_server import free_ports, serving
from tiny_bundle import write_tiny_bundle

from manipnet import cli
from manipnet.net.curve_keys import make_client_keys, make_server_keys, read_client_keys
from manipnet.synthesis.objects.library import LIBRARY_FOLDER

CUBE = LIBRARY_FOLDER / "cube.ply"


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals for another process")
def test_ready_names_every_address_and_a_signal_ends_it_with_status_0(tiny_bundle: Path, how: int) -> None:
    with serving("--model", str(tiny_bundle), "--metrics-port", "0") as server:
        assert list(server.addresses) == ["hands", "web", "bodies", "osc", "control", "page", "trigger", "metrics"]
        with urllib.request.urlopen(server.addresses["metrics"], timeout=20.0) as response:
            text = response.read().decode()
        assert 'manipnet_frames_in_total{source="zmq"} 0.0' in text
        assert 'manipnet_stage_seconds{quantile="0.99",stage="total"}' in text
        assert server.stop(how) == 0
        assert server.errors == [""]


def test_the_line_of_each_second_tells_what_the_server_does(tiny_bundle: Path) -> None:
    with serving("--model", str(tiny_bundle)) as server:
        assert server.line().startswith("waiting for bodies")


@pytest.mark.parametrize(
    "option", ["--port", "--input-port", "--control-port", "--osc-port", "--page-port", "--web-port"]
)
def test_a_port_in_use_is_named_with_its_option(
    tiny_bundle: Path, capsys: pytest.CaptureFixture[str], option: str
) -> None:
    kind = socket.SOCK_DGRAM if option == "--osc-port" else socket.SOCK_STREAM
    with socket.socket(socket.AF_INET, kind) as taken:
        taken.bind(("127.0.0.1", 0))
        if kind == socket.SOCK_STREAM:
            taken.listen()
        port = str(taken.getsockname()[1])
        assert cli.main([*free_ports(), option, port, "--model", str(tiny_bundle)]) == 1
    error = capsys.readouterr().err
    assert option in error
    assert port in error


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--model", "colossus"], "model 'colossus' is neither a folder nor a shipped bundle"),
        (["--mesh", "Box"], "--mesh Box: must be NAME=FILE"),
        (["--mesh", "Box=nowhere.obj"], "nowhere.obj: cannot be read (No such file or directory)"),
        (["--mesh", f"Box={__file__}"], "the format '.py' is unknown; allowed are .obj, .ply, .stl, .glb"),
        (["--rig", "nowhere.toml"], "nowhere.toml: cannot be read"),
        (["--rig", "r.toml", "--mesh", "Box=x.obj"], "--rig cannot be combined with --mesh or --demo"),
        (["--host", "0.0.0.0"], "--host 0.0.0.0 can be reached from other machines"),
        (["--host", "0.0.0.0", "--keys", "keys"], "--allow NETWORK for OSC"),
        (["--allow", "stage"], "--allow is ['stage']; it must be addresses or networks"),
        (["--look-ahead", "2"], "--look-ahead is '2'; it must be a number of seconds, 0 … 0.5"),
        (["--port", "99999"], "--port is '99999'; it must be a port number, 0 … 65535"),
        (["--vmc", "host:port"], "--vmc is 'host:port'; it must be HOST or HOST:PORT"),
    ],
)
def test_a_configuration_that_cannot_be_served_is_refused_in_one_line(
    tiny_bundle: Path, capsys: pytest.CaptureFixture[str], options: list[str], complaint: str
) -> None:
    assert cli.main(["--model", str(tiny_bundle), *options]) == 1
    error = capsys.readouterr().err
    assert error.startswith("manipnet-serve: ")
    assert complaint in error


OPEN_BOX = """v 0 0 0\nv .1 0 0\nv .1 .1 0\nv 0 .1 0\nv 0 0 .1\nv .1 0 .1\nv .1 .1 .1\nv 0 .1 .1
f 1 4 3 2\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"""


def test_an_open_mesh_is_refused_with_the_remedy(
    tiny_bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    box = tmp_path / "box.obj"
    box.write_text(OPEN_BOX)
    assert cli.main(["--model", str(tiny_bundle), "--mesh", f"Box={box}"]) == 1
    assert "box.obj: is not closed" in capsys.readouterr().err


def test_a_bundle_of_another_layout_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_tiny_bundle(tmp_path / "other")
    meta = folder / "bundle.json"
    meta.write_text(meta.read_text().replace('"proximity"', '"sonar"'))
    assert cli.main(["--model", str(folder)]) == 1
    assert "another feature layout" in capsys.readouterr().err


def test_with_keys_only_listed_clients_are_admitted(tiny_bundle: Path, tmp_path: Path) -> None:
    make_server_keys(tmp_path)
    keys = read_client_keys(make_client_keys(tmp_path, "stage-pc"))
    with serving("--model", str(tiny_bundle), "--keys", str(tmp_path)) as server:
        with zmq.Context() as context:
            for what, kind in (("hands", zmq.SUB), ("bodies", zmq.PUB), ("control", zmq.REQ)):
                with context.socket(kind) as stranger:
                    stranger.setsockopt(zmq.LINGER, 0)
                    monitor = stranger.get_monitor_socket(zmq.EVENT_DISCONNECTED | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL)
                    stranger.connect(server.addresses[what])
                    assert monitor.poll(20_000), f"{what}: a client without keys was let in"
                    stranger.disable_monitor()
                    monitor.close()
        counters = server.ask({"op": "status"}, keys=keys)["counters"]
        assert counters["connections_refused"]["handshake"] >= 3
        assert "left" in server.ask({"op": "status"}, keys=keys)["actors"]["actor"]["hands"]


def test_missing_keys_are_named(tiny_bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--model", str(tiny_bundle), "--keys", str(tmp_path)]) == 1
    assert "server.toml does not exist; `manipnet keys make server` makes it" in capsys.readouterr().err
