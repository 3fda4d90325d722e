"""NatNet packets: the real capture value by value, synthetic frames of every version, hostile bytes."""

import contextlib
import itertools
import struct

import natnet_capture
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from natnet_writer import Body, Frame, definitions, packet, server_info

from manipnet.inputs.natnet.definitions import read_definitions
from manipnet.inputs.natnet.frames import read_frame
from manipnet.inputs.natnet.protocol import (
    MessageId,
    check_version,
    connect_payload,
    read_echo,
    read_packet,
    read_server_info,
    write_packet,
)
from manipnet.wire.bodies import MessageError

VERSIONS = [(2, 7), (2, 8), (2, 9), (2, 10), (3, 0), (3, 1), (4, 0), (4, 1), (4, 2), (4, 3), (4, 4), (4, 5)]


@pytest.fixture(params=VERSIONS, ids=lambda v: f"{v[0]}.{v[1]}")
def version(request):
    return request.param


# The real capture


def test_capture_frames_are_what_the_vendors_client_printed():
    printed = natnet_capture.printed_frames()
    seen = {frame.number: frame for frame in (read_frame(p, (3, 0)) for p in natnet_capture.frames())}
    assert len(seen) == 518
    both = sorted(printed.keys() & seen.keys())
    assert len(both) > 240
    for number in both:
        frame, expected = seen[number], printed[number]
        (body,) = frame.bodies
        assert frame.timestamp_s == pytest.approx(expected["timestamp_s"], abs=0.005001)
        assert (body.id, body.tracked) == (expected["id"], expected["tracked"])
        assert body.mean_error == pytest.approx(expected["mean_error"], abs=0.005001)
        assert [*body.p, *body.q] == pytest.approx(expected["pose"], abs=0.005001)
        for since, key in (frame.received_ticks, "software_ms"), (frame.exposed_ticks, "system_ms"):
            latency_ms = (frame.transmitted_ticks - since) / 3_312_787 * 1e3
            assert latency_ms == pytest.approx(expected[key], abs=0.005001)
        assert not frame.recording
        assert not frame.models_changed


def test_capture_frames_follow_each_other():
    frames = [read_frame(payload, (3, 0)) for payload in natnet_capture.frames()]
    for one, two in itertools.pairwise(frames):
        assert two.number == one.number + 1
        assert two.timestamp_s - one.timestamp_s == pytest.approx(1 / 120, abs=1e-9)
        assert two.exposed_ticks > one.exposed_ticks


def test_capture_handshake():
    answers = {}
    for datagram in natnet_capture.datagrams():
        message_id, payload = read_packet(datagram.data)
        answers.setdefault(message_id, payload)
    info = read_server_info(answers[MessageId.SERVER_INFO])
    assert (info.application, info.application_version, info.version) == ("Motive", (2, 1, 0, 0), (3, 0))
    assert (info.clock_hz, info.data_port, info.multicast_group) == (3_312_787, 1511, "239.255.42.99")
    assert read_definitions(answers[MessageId.MODEL_DEFINITIONS], info.version).names() == {2: "RaceQuad"}
    sent, server_ticks = read_echo(answers[MessageId.ECHO_RESPONSE])
    assert sent.to_bytes(8, "little") == answers[MessageId.ECHO_REQUEST]
    assert server_ticks == 0x0149CDD8380F
    assert len(connect_payload("ManipNet Live")) == len(answers[MessageId.CONNECT])


def test_single_packets_of_the_capture():
    folder = natnet_capture.folder()
    read = {path.name: read_packet(path.read_bytes()) for path in folder.glob("*_v3.bin")}
    assert read["requestmodeldef_packet_v3.bin"] == (MessageId.MODEL_REQUEST, b"")
    assert read_frame(read["mocapframe_packet_v3.bin"][1], (3, 0)).number == 162_734
    assert read_definitions(read["modeldef_packet_v3.bin"][1], (3, 0)).names() == {2: "RaceQuad"}
    assert read_echo(read["echoresponse_packet_v3.bin"][1])[0] == 0x109A664E


# Synthetic packets of every version


@pytest.mark.parametrize("full", [True, False])
def test_bodies_and_time_are_found_behind_every_section(version, full):
    frame = read_frame(Frame(full=full).write(version), version)
    assert (frame.number, frame.timestamp_s) == (7, 12.5)
    stamps = (frame.exposed_ticks, frame.received_ticks, frame.transmitted_ticks)
    assert stamps == ((1_000, 2_000, 3_000) if version >= (3, 0) else (0, 0, 0))
    assert frame.timecode == "01:02:03:04"
    assert [(each.id, len(each.bones)) for each in frame.skeletons] == ([(9, 3)] if full else [])
    assert frame.unused.get("labelled markers", 0) == (6 if full else 0)
    assert [(body.id, body.tracked) for body in frame.bodies] == [(1, True), (2, False)]
    assert frame.bodies[0].p == pytest.approx((0.1, 0.2, 0.3))
    assert frame.bodies[0].q == (0.0, 0.0, 0.0, 1.0)
    assert frame.bodies[0].mean_error == pytest.approx(0.001)


@pytest.mark.parametrize(
    ("flags", "expected"),
    [(0, (False, False, False)), (1, (True, False, False)), (2, (False, True, False)), (4, (False, False, True))],
)
def test_frame_flags(version, flags, expected):
    frame = read_frame(Frame(flags=flags).write(version), version)
    assert (frame.recording, frame.models_changed, frame.live) == expected


@pytest.mark.parametrize("tail", [b"", b"\0\0\0\0", b"something a later version adds"])
def test_what_follows_the_frame_is_ignored(version, tail):
    assert read_frame(Frame(tail=tail).write(version), version).timestamp_s == 12.5


def test_only_the_tracked_bit_counts(version):
    bodies = [Body(n, params=params) for n, params in enumerate([0, 1, 2, 3, -1])]
    frame = read_frame(Frame(bodies=bodies).write(version), version)
    assert [body.tracked for body in frame.bodies] == [False, True, False, True, True]


def test_names_are_found_behind_every_kind_of_definition(version):
    names = {2: "RaceQuad", 1_001: "left wrist", 5: "Tässchen"}
    assert read_definitions(definitions(names, version), version).names() == names


def test_bones_have_the_names_of_skeleton_and_bone(version):
    skeletons = {5: ("Ann", {1: "Hip", 9: "Ann_LHand", 13: "RHand"}), 6: ("Bob", {9: "LHand"})}
    found = read_definitions(definitions({}, version, skeletons), version)
    assert found.bones == {(5, 1): "Ann:Hip", (5, 9): "Ann:LHand", (5, 13): "Ann:RHand", (6, 9): "Bob:LHand"}
    assert found.skeletons == {5: "Ann", 6: "Bob"}


def test_ids_and_names_that_occur_twice_are_refused_by_name(version):
    bodies = [(3, "Box"), (3, "Stick"), (4, "Cup"), (5, "Cup"), (6, "left")]
    found = read_definitions(definitions(bodies, version), version)
    assert found.names() == {6: "left"}
    of_id, of_name = found.conflicts()
    assert "'Box' and 'Stick' have the streaming id 3" in of_id
    assert "the streaming ids 4 and 5 have the name 'Cup'" in of_name


def test_names_in_other_encodings_are_read(version):
    raw = {1: "Würfel".encode("cp1252"), 2: "左手".encode("shift_jis"), 3: "手".encode("shift_jis")}
    assert read_definitions(definitions(raw, version), version, frozenset({"手"})).names() == {
        1: "Würfel",
        2: "左手",
        3: "手",
    }


@pytest.mark.parametrize(
    ("packed", "text"),
    [(0, None), (0x17_3B_3B_1D, "23:59:59:29"), (0x18_00_00_00, None), (0x01_3C_00_00, None), (0xFFFFFFFF, None)],
)
def test_timecode(version, packed, text):
    assert read_frame(Frame(timecode=packed).write(version), version).timecode == text


def test_unreadable_names_are_left_out(version):
    found = read_definitions(definitions({1: "", 2: "a\nb", 3: "x" * 200, 4: "ok"}, version), version)
    assert found.names() == {4: "ok"}


def test_a_later_version_with_longer_bodies_is_still_read():
    bodies = [Body(1), Body(2)]
    for body in bodies:
        written = body.write()
        body.write = lambda version, written=written: written + b"more"  # pyright: ignore[reportAttributeAccessIssue]
    frame = read_frame(Frame(bodies=bodies).write((4, 5)), (4, 9))
    assert [body.id for body in frame.bodies] == [1, 2]


def test_definitions_of_an_unknown_kind_are_skipped_if_their_size_is_known():
    known = definitions({4: "Box"}, (4, 1))
    count = struct.unpack_from("<i", known)[0]
    data = struct.pack("<iii", count + 1, 99, 3) + b"???" + known[4:]
    assert read_definitions(data, (4, 1)).names() == {4: "Box"}
    assert read_definitions(struct.pack("<ii", 1, 99), (3, 0)).names() == {}


@pytest.mark.parametrize("group", [None, "239.255.42.99"])
def test_server_info(version, group):
    info = read_server_info(server_info(version, 10_000_000, 1611, group))
    assert (info.version, info.clock_hz, info.data_port) == (version, 10_000_000, 1611)
    assert info.multicast_group == group
    check_version(info.version)


@pytest.mark.parametrize("version", [(2, 6), (1, 9), (5, 0), (0, 0)])
def test_versions_that_are_not_understood_are_named(version):
    with pytest.raises(
        MessageError, match=rf"speaks NatNet {version[0]}\.{version[1]}, and this program understands 2\.7 "
    ):
        check_version(version)


# Wrong packets


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", "0 bytes"),
        (b"\7\0\4", "3 bytes"),
        (b"\7\0\4\0\0", "announces a payload of 4 bytes, but has 1"),
    ],
)
def test_wrong_packets_are_named(data, expected):
    with pytest.raises(MessageError, match=expected):
        read_packet(data)


@pytest.mark.parametrize(
    ("payload", "in_version", "expected"),
    [
        (b"", (3, 0), "ends at byte 0"),
        (struct.pack("<ii", 1, -1), (3, 0), "announces -1 elements"),
        (struct.pack("<ii", 1, 2**31 - 1), (3, 0), "announces 2147483647 elements"),
        (struct.pack("<ii", 1, 1) + b"no end", (3, 0), "has no end"),
        (struct.pack("<iii", 1, 0, 2**31 - 1), (4, 1), "announces 2147483647 bytes"),
        (struct.pack("<iii", 1, 0, -4), (4, 1), "announces -4 bytes"),
        (Frame(bodies=[Body(n) for n in range(257)]).write((3, 0)), (3, 0), "257 rigid bodies"),
        (Frame(timestamp_s=float("nan")).write((3, 0)), (3, 0), "has the time nan"),
        (struct.pack("<ii", 1, 2_000) + b"\0\0\0\0\0" * 2_000, (3, 0), "more than 1024 parts"),
        (struct.pack("<iiiiiiii", 1, 0, 0, 0, 0, 2, 10, 0) + bytes(99), (4, 1), "announces 2 rigid bodies"),
    ],
)
def test_wrong_frames_are_named(payload, in_version, expected):
    with pytest.raises(MessageError, match=expected):
        read_frame(payload, in_version)


def test_every_cut_of_a_frame_is_noticed(version):
    whole = Frame(tail=b"").write(version)
    for size in range(len(whole)):
        with pytest.raises(MessageError):
            read_frame(whole[:size], version)


@pytest.mark.parametrize("read", [read_server_info, read_echo])
def test_short_answers_are_noticed(read):
    with pytest.raises(MessageError, match="needed"):
        read(b"short")


def test_the_server_info_may_end_after_the_versions():
    info = read_server_info(server_info((4, 1))[:264])
    assert (info.version, info.clock_hz, info.data_port, info.multicast_group) == ((4, 1), 0, 1511, None)


@pytest.mark.parametrize("changes", [{"clock_hz": 2**63}, {"data_port": 0}])
def test_impossible_server_info_is_noticed(changes):
    with pytest.raises(MessageError, match="server info names"):
        read_server_info(server_info(**changes))


def digest(data, version):
    for read in (
        read_packet,
        read_server_info,
        read_echo,
        lambda payload: read_frame(payload, version),
        lambda payload: read_definitions(payload, version),
    ):
        with contextlib.suppress(MessageError):
            read(data)


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=400), st.sampled_from(VERSIONS))
def test_any_bytes_raise_only_message_error(data, version):
    digest(data, version)


@settings(max_examples=400, deadline=None)
@given(st.data(), st.sampled_from(VERSIONS), st.booleans())
def test_any_damage_raises_only_message_error(data, version, is_frame):
    whole = bytearray(Frame().write(version) if is_frame else definitions({1: "a", 2: "b"}, version))
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    digest(bytes(whole[: data.draw(st.integers(0, len(whole)))]), version)


def test_written_packets_are_read_back():
    assert read_packet(write_packet(MessageId.KEEP_ALIVE)) == (10, b"")
    assert read_packet(packet(7, b"abc")) == (7, b"abc")
