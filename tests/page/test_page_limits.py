"""What visitors can take of the page: places, files that are dropped on it, and the shapes that it keeps."""

import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest
import viser
from live_server import PATIENCE_S, LiveServer, serving
from test_serialization import message
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.frames import CloseCode
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from manipnet.page.frames import Frame, PropView, ShapeView
from manipnet.page.hand_look import look_of
from manipnet.page.serialization import unpack
from manipnet.page.show import Show
from manipnet.page.supervisor import LivePage
from manipnet.page.web_server import MAX_DROPS, MAX_VISITORS, open_server
from manipnet.synthesis.hand.hand_file import HAND_FILE
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.library import load_library_mesh
from manipnet.synthesis.objects.shape import build_shape
from manipnet.telemetry import Telemetry

VISITOR = Subprotocol(f"viser-v{viser.__version__}")
NOWHERE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def server(tiny_bundle: Path) -> Iterator[LiveServer]:
    with serving("--mesh", "Box=cube", "--model", str(tiny_bundle)) as server:
        yield server


def visit(server: LiveServer, path: str = "/", **options: Any) -> ClientConnection:
    address = server.addresses["page"].replace("http:", "ws:")
    return connect(f"{address}{path}", subprotocols=[VISITOR], max_size=None, open_timeout=PATIENCE_S, **options)


def test_visitors_beyond_the_limit_are_refused_until_one_leaves(server: LiveServer) -> None:
    with ExitStack() as crowd:
        first = [crowd.enter_context(admitted(server)) for _ in range(MAX_VISITORS)]
        with visit(server) as late, pytest.raises(ConnectionClosed, match=f"at most {MAX_VISITORS} visitors"):
            late.recv(PATIENCE_S)
        first[0].close()
        give_up_s = time.monotonic() + PATIENCE_S
        while not is_admitted(server):
            assert time.monotonic() < give_up_s, "the place of a visitor who has left stays taken"
    assert "counters" in server.ask({"op": "status"})


def admitted(server: LiveServer) -> ClientConnection:
    """A visitor who has received something. As a browser does, he comes again if the page, which may still be setting
    up its scene, fails under him."""
    give_up_s = time.monotonic() + PATIENCE_S
    while True:
        visitor = visit(server)
        try:
            assert visitor.recv(PATIENCE_S)
        except ConnectionClosed as closed:
            if closed.rcvd is None or closed.rcvd.code != CloseCode.INTERNAL_ERROR or time.monotonic() > give_up_s:
                raise
        else:
            return visitor


def is_admitted(server: LiveServer) -> bool:
    with visit(server) as visitor:
        try:
            return bool(visitor.recv(PATIENCE_S))
        except ConnectionClosed:
            return False


def test_files_beyond_the_limit_are_refused_while_others_are_sent(server: LiveServer) -> None:
    with ExitStack() as crowd:
        for _ in range(MAX_DROPS):
            crowd.enter_context(visit(server, "/drop?name=mesh.obj"))
        with (
            visit(server, "/drop?name=mesh.obj") as late,
            pytest.raises(ConnectionClosed, match=f"at most {MAX_DROPS} files at a time"),
        ):
            late.recv(PATIENCE_S)
    with visit(server, "/drop?name=mesh.obj") as file:
        file.send(b"v 0 0 0")
        assert "none is open" in str(file.recv(PATIENCE_S)), "a place is free again, and no operator is here"


@pytest.mark.parametrize("path", ["/", "/drop?name=mesh.obj"])
@pytest.mark.parametrize("origin", ["http://localhost:3000", "http://127.0.0.1", "null", "http://evil.test"])
def test_a_socket_of_another_page_is_refused(server: LiveServer, path: str, origin: str) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        visit(server, path, origin=Origin(origin))


def frame(actor: str, *hashes: str) -> Frame:
    props = tuple(PropView(f"body {name}", name, name, 1.0, NOWHERE) for name in hashes)
    return Frame(replace(message(), actor=actor), props, {}, {})


def test_the_page_forgets_the_shapes_that_nobody_carries() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        server = open_server(listener, "test", lambda *_: "")
        try:
            show = Show(server, look_of(shipped_hand()), lambda _: None)
            for k in range(100):
                show.add_shape(ShapeView("cube", f"{k}", np.zeros((3, 3)), np.array([[0, 1, 2]])))
                show.add_frame(frame("ann", f"{k}"))
            show.add_shape(ShapeView("cube", "bob's", np.zeros((3, 3)), np.array([[0, 1, 2]])))
            show.add_frame(frame("bob", "bob's"))
            show.add_frame(frame("ann", "99"))
            assert set(show._shapes) == {"99", "bob's"}
        finally:
            server.stop()


def test_a_shape_that_the_page_has_forgotten_is_sent_again(tiny_bundle: Path) -> None:
    cube, mug = (build_shape(load_library_mesh(name)) for name in ("cube", "mug"))
    page = LivePage("127.0.0.1", 0, lambda *_: None, Telemetry(), tiny_bundle / HAND_FILE)
    ours, theirs = Pipe()
    sender = Thread(target=page._send, args=(ours,))
    sender.start()
    received: list[str] = []
    try:
        for shape in (cube, mug, cube):
            with page._arrived:
                page._newest["ann"] = frame("ann", shape.content_hash), [shape]
                page._arrived.notify()
            while not received or received[-1] != "frame":
                assert theirs.poll(PATIENCE_S)
                what, content = unpack(theirs.recv_bytes())
                received.append(what if what == "frame" else content.content_hash)
            received.append("seen")
    finally:
        ours.close()
        with page._arrived:
            page._arrived.notify()
        sender.join()
        theirs.close()
        page.stop()
    assert received == [
        *(cube.content_hash, "frame", "seen"),
        *(mug.content_hash, "frame", "seen"),
        *(cube.content_hash, "frame", "seen"),
    ]


def test_a_fault_while_the_page_waits_for_a_visitor_does_not_end_it(tiny_bundle: Path, monkeypatch) -> None:
    page = LivePage("127.0.0.1", 0, lambda *_: None, Telemetry(), tiny_bundle / HAND_FILE)
    waits: list[float] = []

    def no_descriptor_left() -> bool:
        waits.append(time.monotonic())
        raise OSError("too many open files")

    monkeypatch.setattr(page, "_visited", no_descriptor_left)
    page.start()
    give_up_s = time.monotonic() + PATIENCE_S
    while len(waits) < 2:
        assert time.monotonic() < give_up_s, "the thread of the page has ended"
    page.stop()
