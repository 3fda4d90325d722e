"""The Python client reads the golden vectors and a real publisher that is killed, restarted and paused."""

import asyncio
import json
import os
import signal
import threading
from itertools import pairwise

import generate
import make_vectors
import pytest
from checkout import VECTORS, publishing
from manipnet_client import Client, MessageError, decode, subscribe, subscribe_async
from manipnet_client.zmtp import parse_address

EXPECTED = json.loads((VECTORS / "expected.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", generate.files(), ids=lambda p: p.name)
def test_generated_layouts_follow_the_schema(path):
    assert path.read_text(encoding="utf-8") == generate.files()[path], "run clients/generate.py"


@pytest.mark.parametrize("name", EXPECTED)
def test_reads_the_golden_vectors(name):
    hands = decode((VECTORS / f"{name}.bin").read_bytes())
    want = EXPECTED[name]
    assert (hands.session, hands.actor, hands.seq) == (want["session"], want["actor"], want["seq"])
    assert [hands.t_capture, hands.t_publish, hands.look_ahead] == [
        want[key] for key in ("t_capture", "t_publish", "look_ahead")
    ]
    assert list(hands.latency_ms) == want["latency_ms"]
    assert {side for side in ("left", "right") if hands.hand(side)} == want["hands"].keys()
    for side, values in want["hands"].items():
        hand = hands.hand(side)
        assert hand is not None
        assert (hand.state, hand.object, hand.scale) == (values["state"], values["object"], values["scale"])
        for field in ("angles", "rotations", "wrist", "joints"):
            assert getattr(hand, field).ravel().tolist() == values[field]
    assert [{"name": b.name, "tracked": b.tracked, "pose": b.pose.tolist()} for b in hands.bodies] == want["bodies"]


@pytest.mark.parametrize("name", sorted(make_vectors.broken(b"\0" * 4000)))
def test_refuses_broken_vectors(name):
    with pytest.raises(MessageError):
        decode((VECTORS / f"bad_{name}.bin").read_bytes())


def test_another_version_is_refused_with_both_named():
    with pytest.raises(MessageError, match=r"version 2.* version 1"):
        decode((VECTORS / "bad_version_2.bin").read_bytes())


@pytest.mark.parametrize("address", ["127.0.0.1:5555", "tcp://", "tcp://host", "tcp://host:0", "tcp://host:99999"])
def test_a_wrong_address_is_refused_at_once(address):
    with pytest.raises(ValueError, match=r"tcp://HOST:PORT"):
        subscribe(address)


def test_parse_address():
    assert parse_address("tcp://127.0.0.1:5555") == ("127.0.0.1", 5555)
    assert parse_address("tcp://[::1]:80") == ("::1", 80)


def test_every_frame_arrives():
    with publishing() as (_, address, _), Client(address) as client:
        while client.stats().received < 60:
            assert client.wait(after=client.newest, timeout_s=10)
        assert client.stats().lost == 0


def strictly_increasing(numbers):
    return all(before < after for before, after in pairwise(numbers))


def test_iteration_in_one_line():
    with publishing() as (_, address, _):
        stream = subscribe(address)
        seqs = [next(stream).seq for _ in range(3)]
        stream.close()
    assert strictly_increasing(seqs)


def test_async_iteration():
    async def first_three(address):
        seen = []
        async for hands in subscribe_async(address):
            seen.append(hands.seq)
            if len(seen) == 3:
                break
        return seen

    with publishing() as (_, address, _):
        seqs = asyncio.run(asyncio.wait_for(first_three(address), 20))
    assert strictly_increasing(seqs)


def test_server_killed_and_restarted():
    threads = threading.active_count()
    with publishing("--session", "a") as (process, address, _), Client(address) as client:
        hands = client.wait(timeout_s=10)
        assert hands is not None
        assert hands.session == "a"
        process.kill()
        process.wait()
        port = address.rpartition(":")[2]
        with publishing("--session", "b", "--port", port):
            while hands.session == "a":
                hands = client.wait(after=hands, timeout_s=10)
                assert hands is not None
        stats = client.stats()
    assert stats.connections == 2
    assert stats.lost == 0
    assert threading.active_count() == threads


def test_a_short_stall_of_the_publisher_keeps_the_connection():
    with publishing() as (process, address, _), Client(address) as client:
        hands = client.wait(timeout_s=10)
        os.kill(process.pid, signal.SIGSTOP)
        os.kill(process.pid, signal.SIGCONT)
        assert client.wait(after=hands, timeout_s=10) is not None
        assert client.stats().connections == 1


def test_interpolates_at_display_rate():
    with publishing() as (_, address, _), Client(address) as client:
        client.wait(timeout_s=10)
        shown = client.sample()
        assert shown is not None
        assert shown.hands.left is not None
        assert shown.weight == 1.0
        assert shown.hands.left.joints.shape == (26, 7)


def test_only_the_chosen_actor():
    with publishing() as (_, address, _), Client(address, actor="nobody") as client:
        assert client.wait(timeout_s=0.3) is None


def test_closing_while_there_is_no_server():
    client = Client("tcp://127.0.0.1:1")
    client.close()
    assert client.stats().state == "closed"
