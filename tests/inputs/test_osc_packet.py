"""The strict OSC reader, against python-osc's writer and against datagrams that break other parsers."""

import contextlib
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from osc_writer import bundle, osc
from pythonosc.osc_bundle_builder import OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder

from manipnet.inputs.osc.packet import (
    IMMEDIATELY,
    MAX_DATAGRAM_BYTES,
    MAX_DEPTH,
    MAX_MESSAGES,
    check_address,
    read_address,
    read_arguments,
    split_packet,
    time_tag_to_s,
)
from manipnet.wire.bodies import MessageError
from manipnet.wire.text import read_text

CYRILLIC = "\u042f\u0449\u0438\u043a"
MESSAGE = b"/a\0\0,i\0\0\0\0\0\7"


def message(address, value):
    builder = OscMessageBuilder(address)
    builder.add_arg(value)
    return builder.build()


def read(message):
    raw, offset = read_address(message)
    return check_address(raw), read_arguments(message, offset)


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        (1, -2, 0.5, "text", "", "four", b"blob5", True, False),
        (("d", 0.1), ("h", -(2**40)), ("N", None)),
        ("ünïcode", 1.0),
    ],
)
def test_what_python_osc_writes_is_read(arguments):
    values = tuple(a[1] if isinstance(a, tuple) else a for a in arguments)
    assert read(osc("/some/address", *arguments)) == ("/some/address", values)


def test_bundles_are_read_in_order_with_their_time():
    builder = OscBundleBuilder(1_000.5)  # pyright: ignore[reportArgumentType]: the time is a number of seconds
    builder.add_content(message("/one", 1))
    inner = OscBundleBuilder(1)
    inner.add_content(message("/two", 2))
    builder.add_content(inner.build())
    messages = split_packet(builder.build().dgram).messages
    assert [read(message) for _, message in messages] == [("/one", (1,)), ("/two", (2,))]
    assert time_tag_to_s(messages[0][0]) == pytest.approx(1_000.5, abs=1e-6)


def test_innermost_time_tag_counts_unless_it_says_immediately():
    data = bundle(MESSAGE, bundle(MESSAGE), bundle(MESSAGE, tag=9 << 32), tag=5 << 32)
    assert [tag >> 32 for tag, _ in split_packet(data).messages] == [5, 5, 9]
    assert split_packet(MESSAGE).messages == [(IMMEDIATELY, MESSAGE)]


def nested(depth):
    data = MESSAGE
    for _ in range(depth):
        data = bundle(data)
    return data


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", "0 bytes"),
        (b"/a\0", "3 bytes"),
        (b"/a\0\0,", "multiple of 4"),
        (b"abcd", "must be '/'"),
        (b"#bundle\0", "time tag"),
        (b"#bundlE\0" + bytes(8), "must be '/'"),
        (bundle() + struct.pack(">i", -4), "size -4"),
        (bundle() + struct.pack(">i", 0), "size 0"),
        (bundle() + struct.pack(">i", 2**31 - 1), "0 bytes are left"),
        (bundle(MESSAGE)[:-4], "12"),
        (bundle(b"/ab"), "multiple of 4"),
        (bundle(b"zzzz"), "must be '/'"),
        (nested(MAX_DEPTH + 1), "nested"),
        (nested(1_000), "nested"),
        (bytes(MAX_DATAGRAM_BYTES + 4), "are allowed"),
    ],
)
def test_wrong_packets_are_named(data, expected):
    with pytest.raises(MessageError, match=expected):
        split_packet(data)


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (bundle(MESSAGE, b"zzzz", MESSAGE), "must be '/'"),
        (bundle(MESSAGE, b"/ab", MESSAGE), "multiple of 4"),
        (bundle(MESSAGE, nested(MAX_DEPTH), MESSAGE), "nested"),
        (bundle(MESSAGE, MESSAGE) + struct.pack(">i", 2**31 - 1), "0 bytes are left"),
        (bundle(MESSAGE, MESSAGE) + struct.pack(">i", -4) + MESSAGE, "size -4"),
    ],
)
def test_a_wrong_part_of_a_bundle_costs_only_itself(data, fault):
    messages, (found,) = split_packet(data)
    assert [message for _, message in messages] == [MESSAGE, MESSAGE]
    assert fault in found


def test_the_first_messages_of_a_bundle_that_is_too_large_are_read():
    messages, (fault,) = split_packet(bundle(*[MESSAGE] * (MAX_MESSAGES + 1)))
    assert len(messages) == MAX_MESSAGES
    assert "more than" in fault


@pytest.mark.parametrize(
    ("raw", "expected", "text"),
    [
        ("Würfel".encode(), (), "Würfel"),
        ("Würfel".encode("cp1252"), (), "Würfel"),
        ("左手".encode("shift_jis"), (), "左手"),
        ("あ".encode("shift_jis"), (), "あ"),
        ("手".encode("shift_jis"), (), "Žè"),  # the bytes do not tell
        ("手".encode("shift_jis"), ("手",), "手"),
        (CYRILLIC.encode("cp1251"), (CYRILLIC, 3), CYRILLIC),
        ("Łuk".encode("cp1250"), (), "Łuk"),
        (b"\xff\xfe", (), "ÿþ"),
    ],
)
def test_text_of_other_encodings_is_read(raw, expected, text):
    assert read_text(raw, expected) == text
    padded = raw + bytes(4 - len(raw) % 4)
    assert read_arguments(b"/a\0\0,s\0\0" + padded, 8 - 4, expected) == (text,)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"/abc", "does not end"),
        (b"/ab\0,i\0x\0\0\0\7", "does not end"),
        (b"/a\0x,i\0\0\0\0\0\7", "does not end"),
        (b"/*\0\0,i\0\0\0\0\0\7", "without any of"),
        (b"/\n\0\0,i\0\0\0\0\0\7", "printable"),
        (b"/" + b"a" * 299 + bytes(4), "256"),
        (b"/a\0\0xi\0\0\0\0\0\7", "type tags"),
        (b"/a\0\0," + b"i" * 70 + b"\0" + bytes(280), "64"),
        (b"/a\0\0,i\0\0", "cut off"),
        (b"/a\0\0,d\0\0\0\0\0\0", "cut off"),
        (b"/a\0\0,Q\0\0\0\0\0\7", "'Q' is unknown"),
        (b"/a\0\0,i\0\0\0\0\0\7\0\0\0\7", "4 bytes after"),
        (b"/a\0\0,s\0\0abcd", "does not end"),
        (b"/a\0\0,b\0\0\xff\xff\xff\xff", "size -1"),
        (b"/a\0\0,b\0\0\0\0\0\x05abcd", "size 5"),
        (b"/a\0\0,b\0\0", "0 bytes are left"),
    ],
)
def test_wrong_messages_are_named(data, expected):
    with pytest.raises(MessageError, match=expected):
        read(data)


def digest(data):
    with contextlib.suppress(MessageError):
        for _, message in split_packet(data).messages:
            read(message)


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=200) | st.binary(max_size=100).map(lambda b: bundle(b, MESSAGE)))
def test_any_bytes_raise_only_message_error(data):
    digest(data)


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_any_damage_to_a_good_bundle_raises_only_message_error(data):
    good = bytearray(bundle(osc("/a/b", 1, 0.5, "text", b"blob"), nested(2), tag=77))
    for _ in range(data.draw(st.integers(1, 4))):
        good[data.draw(st.integers(0, len(good) - 1))] = data.draw(st.integers(0, 255))
    digest(bytes(good))
    digest(bytes(good[: data.draw(st.integers(0, len(good)))]))
