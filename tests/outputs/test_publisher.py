"""Many clients of the hands: those that do not read, or may not connect, do not affect the others."""

import itertools
import threading
import time
from contextlib import ExitStack

import pytest
import zmq
from publisher import message
from raw_subscriber import PATIENCE_S, SUBSCRIBE, UNSUBSCRIBE, RawSubscriber

from manipnet.config.settings import ServerConfig
from manipnet.control.dispatcher import Dispatcher
from manipnet.control.service import Control
from manipnet.inputs.zeromq import ZEROMQ
from manipnet.inputs.zeromq.receiver import ZmqBodies
from manipnet.net.curve_keys import (
    ClientKeys,
    KeyFileError,
    KeyPair,
    make_client_keys,
    make_server_keys,
    read_server_keys,
)
from manipnet.net.curve_keys import read_client_keys as read_keys
from manipnet.net.zap import secure_client
from manipnet.outputs import open_outputs
from manipnet.outputs.declaration import Emission
from manipnet.outputs.publisher import Publisher
from manipnet.outputs.websocket import WebSocketOptions
from manipnet.outputs.zeromq import ZmqOutputOptions
from manipnet.outputs.zeromq.publisher import ZmqPublisher
from manipnet.outputs.zeromq.subscriptions import FORGET_AFTER_S, Subscriptions
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.telemetry import Telemetry
from manipnet.wire import TOPIC_BIN, TOPIC_MSGPACK, decode_binary, encode_binary, encode_msgpack, hand_topics

CONFIG = ServerConfig((), protocols=(ZmqOutputOptions(port=0), WebSocketOptions(web_port=0)))
MOST_KEPT_BYTES = 6 << 20
"""Kept for a client that does not read: `HIGH_WATER_MARK` messages, and the kernel's buffers of its connection."""


def publisher_of(telemetry, keys=None):
    return Publisher(open_outputs(CONFIG.of, Emission(telemetry, shipped_hand(), keys=keys)), telemetry)


@pytest.fixture
def context():
    with zmq.Context() as context:
        yield context


@pytest.fixture
def telemetry():
    return Telemetry()


@pytest.fixture
def publisher(telemetry):
    publisher = publisher_of(telemetry)
    yield publisher
    publisher.close()


def subscriber(context, address, topic, keys=None, **options):
    sub = context.socket(zmq.SUB)
    sub.setsockopt(zmq.LINGER, 0)
    for name, value in options.items():
        sub.setsockopt(getattr(zmq, name), value)
    if keys is not None:
        secure_client(sub, keys)
    sub.subscribe(topic)
    sub.connect(address)
    return sub


def publish_until_heard(publisher, subs):
    """Publish until every subscriber has received a message. Returns the next number."""
    waiting = list(subs)
    for seq in itertools.count():
        publisher.publish(message(seq, seq / 60, 0.1))
        waiting = [sub for sub in waiting if not sub.poll(10)]
        if not waiting:
            return seq + 1
        assert seq < 2_000, "a subscriber hears nothing"
    return 0


def seq_of(sub):
    return decode_binary(sub.recv()[len(TOPIC_BIN) :]).seq


@pytest.mark.slow
def test_a_subscriber_that_does_not_read_does_not_affect_the_others(publisher, context):
    with ExitStack() as opened:
        readers = [opened.enter_context(subscriber(context, publisher.addresses["hands"], TOPIC_BIN)) for _ in range(2)]
        stopped = opened.enter_context(subscriber(context, publisher.addresses["hands"], b"", RCVHWM=1, RCVBUF=65_536))
        seq = publish_until_heard(publisher, [*readers, stopped])
        for sub in readers:
            while seq_of(sub) < seq - 1:
                pass
        published = 0
        while published < 3 * MOST_KEPT_BYTES:
            both = message(seq, seq / 60, 0.1)
            published += len(encode_binary(both)) + len(encode_msgpack(both))
            publisher.publish(both)
            assert [seq_of(sub) for sub in readers] == [seq] * 2
            seq += 1
        kept = 0
        while stopped.poll(0):
            kept += len(stopped.recv())
    assert kept < MOST_KEPT_BYTES


def test_a_stranger_who_unsubscribes_takes_the_hands_from_nobody(publisher, context):
    with subscriber(context, publisher.addresses["hands"], TOPIC_BIN) as sub:
        seq = publish_until_heard(publisher, [sub])
        while seq_of(sub) < seq - 1:
            pass
        stranger = RawSubscriber(publisher.addresses["hands"])
        stranger.send(UNSUBSCRIBE + TOPIC_BIN)
        stranger.send(SUBSCRIBE + TOPIC_MSGPACK)
        while not stranger.has_received:  # until the publisher has read both
            publisher.publish(message(seq, seq / 60, 0.1))
            assert sub.poll(int(1e3 * PATIENCE_S)), "the hands have stopped"
            assert seq_of(sub) == seq
            seq += 1
        stranger.close()


def test_hands_of_an_avatar_are_wanted_until_the_last_subscriber_leaves_whatever_strangers_send(telemetry, context):
    publisher = ZmqPublisher(telemetry, "127.0.0.1", 0)
    assert publisher.address is not None
    topic = hand_topics("hero")[0]
    sub = subscriber(context, publisher.address, topic)
    wait_until(lambda: publisher.wants("hero"))
    stranger = RawSubscriber(publisher.address)
    stranger.send(UNSUBSCRIBE + topic)
    stranger.send(SUBSCRIBE + hand_topics("other")[0])
    wait_until(lambda: publisher.wants("other"))  # both were read
    assert publisher.wants("hero")
    sub.close()
    wait_until(lambda: not publisher.wants("hero"))
    stranger.close()
    publisher.close()


def wait_until(condition):
    give_up_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < give_up_s


def test_subscriptions_are_forgotten_when_nobody_has_been_connected_for_a_while():
    subscriptions = Subscriptions()
    subscriptions.note(b"\x01pose/", True, 1.0)
    in_time_s = 50.0 + FORGET_AFTER_S
    for connected, now_s, known in ((0, 2.0, True), (1, 50.0, True), (0, in_time_s, True), (0, in_time_s + 1.0, False)):
        subscriptions.count(connected, now_s)
        assert subscriptions.include(TOPIC_MSGPACK) == known


def pair():
    public, secret = zmq.curve_keypair()
    return KeyPair(public.decode(), secret.decode())


def test_a_list_that_cannot_be_read_is_named_and_leaves_nothing_open(tmp_path):
    make_server_keys(tmp_path)
    keys = read_server_keys(tmp_path)
    keys.allow_file.unlink()
    threads = threading.active_count()
    for start in (
        lambda: publisher_of(Telemetry(), keys),
        lambda: Control("127.0.0.1", 0, Dispatcher({}, Telemetry()), Telemetry(), keys),
        ZmqBodies(ZEROMQ.intake(print, Telemetry()), port=0, keys=keys).start,
    ):
        with pytest.raises(KeyFileError, match=r"cannot read .*clients\.allow"):
            start()
    assert threading.active_count() == threads


STRANGERS = {
    "plain": (lambda server: None, "handshake"),
    "wrong server key": (lambda server: ClientKeys("x", pair(), pair().public), "handshake"),
    "not listed": (lambda server: ClientKeys("x", pair(), server), "not_listed"),
}


@pytest.mark.parametrize(("keys", "reason"), STRANGERS.values(), ids=STRANGERS)
def test_clients_without_the_right_keys_can_do_nothing_and_are_counted(context, tmp_path, keys, reason):
    make_server_keys(tmp_path)
    server, friend = read_server_keys(tmp_path), read_keys(make_client_keys(tmp_path, "stage-pc"))
    frames, hands, bodies, control = [], Telemetry(), Telemetry(), Telemetry()
    with ExitStack() as opened:
        publisher = publisher_of(hands, server)
        opened.callback(publisher.close)
        receiver = ZmqBodies(ZEROMQ.intake(frames.append, bodies), port=0, keys=server)
        receiver.start()
        opened.callback(receiver.stop)
        asked = Control("127.0.0.1", 0, Dispatcher({"ping": lambda request: {"t": 0.0}}, control), control, server)
        opened.callback(asked.stop)
        asked.start()
        stranger = keys(server.pair.public)
        watching = opened.enter_context(subscriber(context, publisher.addresses["hands"], b"", stranger))
        sending = opened.enter_context(context.socket(zmq.XPUB))
        asking = opened.enter_context(context.socket(zmq.REQ))
        for sock, address in ((sending, receiver.address), (asking, asked.address)):
            sock.setsockopt(zmq.LINGER, 0)
            if stranger is not None:
                secure_client(sock, stranger)
            sock.connect(address)
        asking.send(b'{"op": "ping"}')
        for telemetry in (hands, bodies, control):
            for _ in range(2_000):
                if telemetry.counts().get("connections_refused", {}).get(reason):
                    break
                assert not watching.poll(10)
            assert telemetry.counts()["connections_refused"][reason] >= 1
        # the reason is told apart by what the handshakes of others do meanwhile, so the friend comes afterwards
        good = opened.enter_context(subscriber(context, publisher.addresses["hands"], TOPIC_MSGPACK, friend))
        publish_until_heard(publisher, [good])
        assert not watching.poll(0)
        assert not sending.poll(0), "the server subscribes to a stranger"
        assert not asking.poll(0)
    assert "control_requests" not in control.counts()
    assert frames == []
