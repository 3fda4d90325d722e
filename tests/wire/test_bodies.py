"""Body messages: what is accepted, and errors that name what is wrong."""

import contextlib
import json
import math

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from manipnet.wire.bodies import MAX_BODIES, MAX_MESSAGE_BYTES, MessageError, bodies_map, parse_bodies

BODY = {"id": 7, "name": "Box", "p": [0.1, 1, -2.5], "q": [0, 0, 0, 2], "tracked": False}
MESSAGE = {"t": 12.5, "frame": 3, "bodies": [BODY]}
ENCODINGS = {"msgpack": msgpack.packb, "json": lambda m: json.dumps(m).encode()}


@pytest.fixture(params=ENCODINGS)
def encode(request):
    return ENCODINGS[request.param]


def with_body(**changes):
    body = {key: value for key, value in {**BODY, **changes}.items() if value is not ...}
    return {**MESSAGE, "bodies": [body]}


def test_message_is_read_whole(encode):
    frame = parse_bodies(encode(MESSAGE), 99.0, "zmq:here")
    (body,) = frame.bodies
    assert (frame.t_s, frame.frame, frame.t_received_s, frame.source) == (12.5, 3, 99.0, "zmq:here")
    assert (body.id, body.name, body.p, body.tracked, body.fault) == (7, "Box", (0.1, 1.0, -2.5), False, None)
    assert body.q == (0.0, 0.0, 0.0, 1.0)


def test_timecode_is_kept(encode):
    frame = parse_bodies(encode({**MESSAGE, "timecode": "10:20:30;04", "timecode_rate": 29.97}), 0.0, "zmq")
    assert (frame.timecode, frame.timecode_rate) == ("10:20:30;04", 29.97)
    assert parse_bodies(encode(bodies_map(frame)), 0.0, "zmq") == frame


def test_a_null_that_is_missing_means_tracked(encode):
    assert parse_bodies(encode(with_body(tracked=None)), 0.0, "zmq").bodies[0].tracked


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8"])
def test_names_of_another_encoding_are_read(encoding):
    name = "Würfel".encode(encoding)
    packed = msgpack.packb(with_body(name="?")).replace(b"\xa1?", bytes([0xA0 + len(name)]) + name)
    assert parse_bodies(packed, 0.0, "zmq").bodies[0].name == "Würfel"
    text = json.dumps(with_body(name="?")).encode().replace(b'"?"', b'"' + name + b'"')
    assert parse_bodies(text, 0.0, "zmq").bodies[0].name == "Würfel"


@pytest.mark.parametrize(
    "message",
    [
        {"t": 0, "bodies": []},
        {"t": 0, "frame": None, "bodies": [], "extra": [1, {"deep": True}]},
        with_body(id=...),
        with_body(name=...),
        with_body(tracked=..., id=-1),
        with_body(tracked=None, name=None),
        with_body(name=""),
        with_body(id=None),
        {**MESSAGE, "timecode": None, "timecode_rate": None},
        {**MESSAGE, "bodies": [{**BODY, "id": i, "name": None} for i in range(MAX_BODIES)]},
    ],
)
def test_optional_parts_may_be_missing(encode, message):
    frame = parse_bodies(encode(message), 0.0, "zmq")
    assert len(frame.bodies) == len(message["bodies"])


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ([], "message is list"),
        ({"bodies": []}, "has no t"),
        ({**MESSAGE, "t": "now"}, "t is 'now'"),
        ({**MESSAGE, "t": True}, "t is True"),
        ({**MESSAGE, "t": math.nan}, "t is nan"),
        ({**MESSAGE, "t": 1.7e12}, "not milliseconds"),
        ({**MESSAGE, "frame": 1.5}, "frame is 1.5"),
        ({**MESSAGE, "frame": True}, "frame is True"),
        ({"t": 1.0}, "bodies is missing"),
        ({**MESSAGE, "bodies": {}}, "bodies is dict"),
        ({**MESSAGE, "bodies": [BODY, 3]}, "bodies[1] is int"),
        ({**MESSAGE, "bodies": [BODY, BODY]}, "two bodies have the id 7"),
        ({**MESSAGE, "bodies": [BODY, {**BODY, "id": 8}]}, "two bodies have the name 'Box'"),
        ({**MESSAGE, "bodies": [{**BODY, "id": i} for i in range(257)]}, "256"),
        (with_body(id=..., name=...), "neither id nor name"),
        (with_body(id="7"), "bodies[0].id is '7'"),
        (with_body(id=1 << 31), "31 bits"),
        (with_body(id=..., name=""), "neither id nor name"),
        ({**MESSAGE, "timecode": "1:2:3"}, "timecode is '1:2:3'; it must be HH:MM:SS:FF"),
        ({**MESSAGE, "timecode": "24:00:00:00"}, "timecode is '24:00:00:00'"),
        ({**MESSAGE, "timecode_rate": 0}, "timecode_rate is 0; it must be a number above 0"),
        (with_body(name="a\nb"), "printable"),
        (with_body(name="x" * 129), "128"),
        (with_body(tracked=1), "bodies[0].tracked is 1"),
        (with_body(p=...), "bodies[0].p is missing"),
        (with_body(p=[1, 2]), "list of 3"),
        (with_body(q=[0, 0, "0", 1]), "bodies[0].q[2] is '0'"),
        (with_body(p={"x": 1}), "a dict of 1"),
    ],
)
def test_wrong_message_is_named(encode, message, expected):
    with pytest.raises(MessageError) as caught:
        parse_bodies(encode(message), 0.0, "zmq")
    assert expected in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"p": [math.nan, 0, 0]}, "nan"),
        ({"q": [0, 0, math.inf, 1]}, "nan"),
        ({"p": [0, -1001, 0]}, "bounds"),
        ({"q": [0, 0, 0, 0]}, "zero_quaternion"),
    ],
)
def test_one_bad_pose_does_not_affect_the_others(encode, changes, fault):
    good = {**BODY, "id": 8, "name": "other", "tracked": True}
    message = {**MESSAGE, "bodies": [{**BODY, "tracked": True, **changes}, good]}
    bad, other = parse_bodies(encode(message), 0.0, "zmq").bodies
    assert (bad.fault, bad.tracked, bad.p, bad.q) == (fault, False, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    assert other.tracked
    assert other.fault is None


def test_zeros_of_a_body_that_is_sent_as_lost_are_not_a_fault(encode):
    (body,) = parse_bodies(encode(with_body(p=[0, 0, 0], q=[0, 0, 0, 0], tracked=False)), 0.0, "zmq").bodies
    assert not body.tracked
    assert body.fault is None


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"garbage",
        b"\xff" * 40,
        b"[" * 60_000,
        b"\x91" * 60_000,
        b'{"t":' + b"9" * 5_000 + b"}",
        b'{"t":' + b"9" * 400 + b',"bodies":[]}',
        b'{"t": 1, "bodies": []} trailing',
        b'\xef\xbb\xbf{"t": 1}',
        b'{"t": "\xff"}',
        b"\xdd\xff\xff\xff\xff",
        b"\x81\x90\x00",
        b"\x81\xa1\xff\x00",
        b"\xd6\xff\x00\x00\x00\x00",
        b"\xc7\x0c\xff" + b"\xff" * 12,
        msgpack.packb(MESSAGE) + b"\x00",
        msgpack.packb(MESSAGE)[:-1],
        b" " * (MAX_MESSAGE_BYTES + 1),
    ],
)
def test_any_payload_is_read_or_refused(payload):
    with pytest.raises(MessageError):
        parse_bodies(payload, 0.0, "zmq")


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=300))
def test_any_bytes_raise_only_message_error(payload):
    with contextlib.suppress(MessageError):
        parse_bodies(payload, 0.0, "zmq")
    assert parse_bodies(msgpack.packb(MESSAGE), 0.0, "zmq").frame == 3


values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=3), inner, max_size=4),
    max_leaves=12,
)


fields = st.fixed_dictionaries({}, optional=dict.fromkeys(BODY, values))


@settings(max_examples=300, deadline=None)
@given(t=values, frame=values, bodies=st.lists(fields | values, max_size=4))
def test_any_structure_gives_a_valid_frame_or_message_error(t, frame, bodies):
    message = msgpack.packb({"t": t, "frame": frame, "bodies": bodies})
    with contextlib.suppress(MessageError):
        parsed = parse_bodies(message, 0.0, "zmq")
        assert math.isfinite(parsed.t_s)
        for body in parsed.bodies:
            assert all(map(math.isfinite, body.p))
            assert math.isclose(math.hypot(*body.q), 1.0, abs_tol=1e-9)


@given(
    p=st.lists(st.floats(-1000, 1000), min_size=3, max_size=3),
    q=st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: math.hypot(*q) > 1e-3),
)
def test_a_pose_survives_writing_and_reading(p, q):
    (body,) = parse_bodies(msgpack.packb(with_body(p=p, q=q)), 0.0, "zmq").bodies
    assert body.p == tuple(p)
    assert body.q == pytest.approx([component / math.hypot(*q) for component in q])
