"""The hands message: golden vectors, round trips, and refusal of everything else."""

import json
import re
from dataclasses import replace

import make_vectors
import msgpack
import numpy as np
import pytest
from checkout import ROOT, VECTORS
from hypothesis import given
from hypothesis import strategies as st

from manipnet import wire
from manipnet.wire.bodies import MessageError
from manipnet.wire.hands import BODY, HAND, HEADER, TIMED_HEADER

MESSAGES = make_vectors.messages()
EXPECTED = json.loads((VECTORS / "expected.json").read_text(encoding="utf-8"))
LIVE = MESSAGES["live"]


def test_files_are_what_the_schema_writes():
    on_disk = {p.name: p.read_bytes() for p in VECTORS.iterdir() if p.suffix in (".bin", ".msgpack")}
    on_disk["expected.json"] = (VECTORS / "expected.json").read_bytes()
    stale = {n for n, data in make_vectors.files().items() if on_disk.get(n) != data}
    assert not stale ^ (on_disk.keys() - make_vectors.files().keys()), "run tests/vectors/make_vectors.py"


@pytest.mark.parametrize("name", EXPECTED)
def test_binary_reads_as_expected(name):
    message = wire.decode_binary((VECTORS / f"{name}.bin").read_bytes())
    assert make_vectors.expected(message) == EXPECTED[name]


@pytest.mark.parametrize("name", MESSAGES)
def test_msgpack_reads_as_expected(name):
    message = wire.decode_msgpack((VECTORS / f"{name}.msgpack").read_bytes())
    assert make_vectors.expected(message) == EXPECTED[name]
    assert message.session == MESSAGES[name].session


def test_timecode_is_in_both_encodings_and_missing_without_one():
    timed = MESSAGES["timecode"]
    for encode, decode in (wire.encode_binary, wire.decode_binary), (wire.encode_msgpack, wire.decode_msgpack):
        message = decode(encode(timed))
        assert message.timecode == "23:59:58;29"
        assert message.timecode_rate == 29.96875
        assert decode(encode(LIVE)).timecode is None
    old = msgpack.unpackb(wire.encode_msgpack(LIVE))
    assert old.pop("timecode") is None
    assert old.pop("timecode_rate") is None
    assert wire.decode_msgpack(msgpack.packb(old)).timecode is None
    assert make_vectors.offset(TIMED_HEADER, "timecode") == HEADER.itemsize == 208


@pytest.mark.parametrize("path", sorted(VECTORS.glob("bad_*.bin")), ids=lambda p: p.stem)
def test_broken_binary_is_refused(path):
    with pytest.raises(MessageError):
        wire.decode_binary(path.read_bytes())


def test_another_version_is_refused_and_both_are_named():
    with pytest.raises(MessageError, match=r"version 2.* version 1"):
        wire.decode_binary((VECTORS / "bad_version_2.bin").read_bytes())
    with pytest.raises(MessageError, match=r"version 9.* version 1"):
        wire.decode_msgpack(msgpack.packb({"v": 9}))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"t_capture": float("nan")}, "t_capture"),
        ({"seq": -1}, "seq"),
        ({"timecode": "1:2"}, "timecode"),
        ({"timecode": "01:02:03:04", "timecode_rate": float("nan")}, "timecode_rate"),
        ({"hands": {"middle": LIVE.hands["left"]}}, "middle"),
        ({"hands": {"left": replace(LIVE.hands["left"], state="dead")}}, "hands.left.state"),
        ({"hands": {"left": replace(LIVE.hands["left"], scale=0.0)}}, "hands.left.scale"),
        ({"hands": {"left": replace(LIVE.hands["left"], angles=np.full(20, np.inf))}}, "hands.left.angles"),
        ({"hands": {"left": replace(LIVE.hands["left"], joints=np.ones((25, 7)))}}, "hands.left.joints"),
        (
            {"hands": {"left": replace(LIVE.hands["left"], rotations=np.ones((17, 4)))}},
            "hands.left.rotations",
        ),
        ({"bodies": LIVE.bodies * 100}, "bodies"),
        ({"bodies": (wire.BodyPose(True, np.zeros(7), "x"),)}, r"bodies\[0\]"),
    ],
)
def test_no_bad_value_is_ever_sent(change, text):
    for encode in (wire.encode_binary, wire.encode_msgpack):
        with pytest.raises(MessageError, match=text):
            encode(replace(LIVE, **change))


def _paths(value, path=()):
    yield path
    if isinstance(value, dict):
        for key in value:
            yield from _paths(value[key], (*path, key))
    elif isinstance(value, list) and value:
        yield from _paths(value[-1], (*path, len(value) - 1))


LIVE_MAP = msgpack.unpackb(wire.encode_msgpack(LIVE))
JUNK = st.sampled_from([None, True, -1, 2**63, float("nan"), float("inf"), "x", b"\xff", [], [[1.0], 2.0], {}, {1: 2}])


@given(st.sampled_from([p for p in _paths(LIVE_MAP) if p]), JUNK)
def test_any_wrong_part_of_a_map_raises_only_message_error(path, junk):
    message = msgpack.unpackb(wire.encode_msgpack(LIVE))
    *parents, last = path
    inner = message
    for key in parents:
        inner = inner[key]
    inner[last] = junk
    try:
        wire.decode_msgpack(msgpack.packb(message))
    except MessageError:
        return


NUMBER = st.floats(-1e12, 1e12)
NAME = st.text(max_size=40) | st.sampled_from(["\xcb\xffManipN\x01", "\xffManipN\x01"])


@given(
    *(NUMBER, NUMBER, st.integers(0, 2**64 - 1), NAME, NAME, st.booleans(), st.booleans()),
    st.none() | st.just(np.array([0.0, 1.0, -2.0])),
)
def test_msgpack_is_the_map_of_the_document_as_any_packer_writes_it(
    number, other, seq, name, thing, tracked, timed, shift
):
    hand = replace(LIVE.hands["left"], object=thing or None, angles=np.full(20, number), wrist_shift=shift)
    message = replace(
        LIVE,
        session=name,
        seq=seq,
        t_capture=other,
        hands={"right": hand} | ({"left": LIVE.hands["left"]} if tracked else {}),
        bodies=tuple(replace(body, name=name, tracked=tracked) for body in LIVE.bodies),
        timecode="01:02:03:04" if timed else None,
        hand=None if shift is None else name,
    )
    payload = wire.encode_msgpack(message)
    content = msgpack.unpackb(payload)
    assert msgpack.packb(content) == payload
    assert content["seq"] == seq
    assert content["hands"]["right"]["angles"] == [number] * 20
    assert content["hands"]["right"].get("wrist_shift") == (None if shift is None else shift.tolist())
    read = wire.decode_msgpack(payload)
    assert make_vectors.expected(read) == make_vectors.expected(message)
    assert (read.session, read.bodies[0].name, read.t_capture) == (name, name, other)


@given(st.binary(max_size=64))
def test_garbage_raises_only_message_error(data):
    for decode in (wire.decode_binary, wire.decode_msgpack):
        with pytest.raises(MessageError):
            decode(data)


@given(st.integers(0, 2855), st.binary(min_size=1, max_size=8))
def test_a_changed_byte_raises_no_other_error(offset, data):
    good = wire.encode_binary(LIVE)
    try:
        message = wire.decode_binary((good[:offset] + data + good[offset + len(data) :])[: len(good)])
    except MessageError:
        return
    wire.check(message)


def test_protocol_document_states_the_true_layout():
    text = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
    rows = {(m[1], int(m[0])) for m in re.findall(r"^\| (\d+) \| `(\w+)`", text, re.MULTILINE)}
    true = {(name, place[1]) for dtype in (HEADER, HAND, BODY) for name, place in (dtype.fields or {}).items()}
    assert rows == true
    for name, dtype in (("Header", HEADER), ("Hand", HAND), ("Body", BODY)):
        assert re.search(rf"{name} record, {dtype.itemsize} bytes", text)
