"""Keys and the allow-list, through real encrypted sockets on loopback."""

import os
import stat
import sys

import msgpack
import pytest
import zmq

from manipnet.inputs.zeromq import ZEROMQ
from manipnet.inputs.zeromq.receiver import ZmqBodies
from manipnet.net.curve_keys import (
    ALLOW_FILE,
    SERVER_FILE,
    ClientKeys,
    KeyFileError,
    KeyPair,
    make_client_keys,
    make_server_keys,
    read_allow_list,
    read_client_keys,
    read_server_keys,
)
from manipnet.net.errors import ListenError
from manipnet.net.zap import secure_client

MESSAGE = msgpack.packb({"t": 1.0, "bodies": [{"id": 1, "p": [0, 0, 0], "q": [0, 0, 0, 1]}]})


@pytest.fixture
def folder(tmp_path):
    make_server_keys(tmp_path)
    return tmp_path


@pytest.fixture
def receiver(folder, heard, telemetry):
    receiver = ZmqBodies(ZEROMQ.intake(heard, telemetry), port=0, keys=read_server_keys(folder))
    receiver.start()
    yield receiver
    receiver.stop()


@pytest.fixture
def connect(receiver):
    """A connected publisher with the given keys. It sends only once the receiver has subscribed."""
    context = zmq.Context()
    made = []

    def connect(keys):
        publisher = context.socket(zmq.XPUB)
        made.append(publisher)
        publisher.setsockopt(zmq.LINGER, 0)
        if keys is not None:
            secure_client(publisher, keys)
        publisher.connect(receiver.address)
        return publisher

    yield connect
    for publisher in made:
        publisher.close()
    context.term()


def send(publisher):
    assert publisher.poll(20_000)
    assert publisher.recv() == b"\x01"
    publisher.send(MESSAGE)


def wait_for_refusal(telemetry, reason):
    """Wait, for a limited time, until the attempts of a client that is refused have been counted."""
    with zmq.Context() as context, context.socket(zmq.PAIR) as nothing:
        for _ in range(2_000):
            if telemetry.counts().get("connections_refused", {}).get(reason):
                return
            nothing.poll(10)
    pytest.fail(f"nothing was counted as {reason}: {telemetry.counts()}")


def pair():
    public, secret = zmq.curve_keypair()
    return KeyPair(public.decode(), secret.decode())


def test_a_listed_client_may_send(folder, connect, heard):
    send(connect(read_client_keys(make_client_keys(folder, "stage-pc"))))
    assert heard.next().t_s == 1.0


@pytest.mark.parametrize(
    ("keys", "reason"),
    [
        (lambda folder: None, "handshake"),
        (lambda folder: ClientKeys("x", pair(), pair().public), "handshake"),
        (lambda folder: ClientKeys("x", pair(), read_server_keys(folder).pair.public), "not_listed"),
    ],
    ids=["plain", "wrong server key", "not listed"],
)
def test_other_clients_are_refused_and_counted(folder, connect, heard, telemetry, keys, reason):
    stranger = connect(keys(folder))
    wait_for_refusal(telemetry, reason)
    assert not stranger.poll(0)
    stranger.send(MESSAGE)
    send(connect(read_client_keys(make_client_keys(folder, "stage-pc"))))
    heard.next()
    assert telemetry.counts()["frames_in"] == {"zmq": 1}


def test_a_client_that_was_removed_from_the_list_cannot_connect_again(folder, connect, heard, telemetry):
    keys = read_client_keys(make_client_keys(folder, "stage-pc"))
    send(connect(keys))
    heard.next()
    (folder / ALLOW_FILE).write_text("# nobody\n")
    connect(keys)
    wait_for_refusal(telemetry, "not_listed")


def test_a_list_that_cannot_be_read_lets_nobody_in(folder, connect, heard, telemetry, caplog):
    keys = read_client_keys(make_client_keys(folder, "stage-pc"))
    (folder / ALLOW_FILE).write_text("nonsense\n")
    connect(keys)
    wait_for_refusal(telemetry, "not_listed")
    assert "clients.allow:1: the line must be `public-key name`" in caplog.text


def test_port_in_use_is_named_and_everything_is_closed(folder, receiver, heard, telemetry):
    port = int(receiver.address.rpartition(":")[2])
    with pytest.raises(ListenError, match="in use"):
        ZmqBodies(ZEROMQ.intake(heard, telemetry), port=port, keys=read_server_keys(folder)).start()


# Key files


def test_keys_are_made_read_and_listed(folder):
    server = read_server_keys(folder)
    path = make_client_keys(folder, "stage-pc")
    client = read_client_keys(path)
    assert client.server_public == server.pair.public
    assert read_allow_list(folder / ALLOW_FILE) == {client.pair.public: "stage-pc"}
    assert client.pair.secret not in repr(client)
    assert client.pair.secret not in (folder / ALLOW_FILE).read_text()


posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no file modes")


@posix
@pytest.mark.parametrize("umask", [0, 0o077, 0o277])
def test_files_can_be_used_by_their_owner_only_whatever_the_umask(tmp_path, umask):
    before = os.umask(umask)
    try:
        make_server_keys(tmp_path)
        client = make_client_keys(tmp_path, "a")
    finally:
        os.umask(before)
    for path in (tmp_path / SERVER_FILE, tmp_path / ALLOW_FILE, client):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600


@posix
def test_a_secret_that_others_can_read_is_refused_with_the_remedy(folder):
    client = make_client_keys(folder, "a")
    for path, read in (
        (folder / SERVER_FILE, lambda: read_server_keys(folder)),
        (client, lambda: read_client_keys(client)),
    ):
        path.chmod(0o644)
        with pytest.raises(KeyFileError, match=f"can read {path} .mode 644.; run: chmod 600 {path}"):
            read()


@posix
def test_a_list_that_others_can_change_is_refused_with_the_remedy(folder):
    path = folder / ALLOW_FILE
    path.chmod(0o644)
    assert read_allow_list(path) == {}
    path.chmod(0o666)
    with pytest.raises(KeyFileError, match=f"can change {path} .mode 666.; run: chmod 600 {path}"):
        read_allow_list(path)


def test_keys_are_never_replaced(folder):
    with pytest.raises(KeyFileError, match="already exists"):
        make_server_keys(folder)
    make_client_keys(folder, "a")
    with pytest.raises(KeyFileError, match="already exists"):
        make_client_keys(folder, "a")


@pytest.mark.parametrize("name", ["", "server", "../up", "a b", "x" * 65, ".hidden", "a\n", "NUL", "com1.a"])
def test_wrong_client_names_are_refused(folder, name):
    with pytest.raises(KeyFileError, match="cannot be the name of a client"):
        make_client_keys(folder, name)


def test_the_error_of_a_missing_file_says_how_to_make_it(tmp_path):
    with pytest.raises(KeyFileError, match="manipnet keys make server"):
        read_server_keys(tmp_path)
    with pytest.raises(KeyFileError, match="manipnet keys make NAME"):
        read_client_keys(tmp_path / "a.toml")
    with pytest.raises(KeyFileError, match="cannot read"):
        read_allow_list(tmp_path / ALLOW_FILE)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (b"", "no key 'public'"),
        (b"\xff\xfe", "cannot read"),
        (b"public = 3", "no key 'public'"),
        (b"public = [", "cannot read"),
        (b'public = "short"', "40 Z85"),
    ],
)
def test_wrong_key_files_are_named(folder, text, expected):
    (folder / SERVER_FILE).write_bytes(text)
    with pytest.raises(KeyFileError, match=expected):
        read_server_keys(folder)


@pytest.mark.parametrize("line", ["short name", "é" * 40, "'" * 40 + " name"])
def test_wrong_lines_of_the_list_are_named(folder, line):
    (folder / ALLOW_FILE).write_text("# comment\n\n" + line + "\n", encoding="utf-8")
    with pytest.raises(KeyFileError, match=r"allow:3: the line must be|cannot read"):
        read_allow_list(folder / ALLOW_FILE)
