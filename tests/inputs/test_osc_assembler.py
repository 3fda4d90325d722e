"""OSC addresses that senders use, and the assembly of messages into frames, with arrival times given by the test."""

import math
import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from osc_streams import HZ, bodies, milliseconds
from osc_writer import bundle, osc

from manipnet.geometry import quat_multiply, quat_to_matrix
from manipnet.inputs.osc.assembler import CLOCK_PATIENCE, GAP_S, MARKED_GAP_S, FrameAssembler
from manipnet.inputs.osc.packet import NTP_TO_UNIX_S, split_packet
from manipnet.inputs.osc.space import AXES, Space
from manipnet.tracking.timeline import Timeline
from manipnet.wire.bodies import MAX_BODIES

UNITY = Space(AXES["unity"]).converter()
P, Q = (0.5, 1.0, -2.0), (0.0, 0.6, 0.0, 0.8)


def play(*datagrams, times=None):
    """The frames of datagrams that arrive 0.1 ms apart, beginning at 100 s, and are followed by silence."""
    assembler = FrameAssembler("osc:test")
    times = times or [100 + 1e-4 * n for n in range(len(datagrams))]
    frames = []
    for datagram, t_s in zip(datagrams, times, strict=True):
        frames += assembler.add(split_packet(datagram), t_s)[0]
    return frames + assembler.flush(times[-1] + 1.0)


def names(frames):
    return [[body.id if body.name is None else body.name for body in frame.bodies] for frame in frames]


def body(key, field, *values):
    return osc(f"/rigidbody/{key}/{field}", *values)


def pose(key):
    return body(key, "transformation", *P, *Q)


def start(n):
    return osc("/frame/start", n)


def end(n):
    return osc("/frame/end", n)


def stamp(ms):
    return osc("/frame/timestamp", ms)


MIRRORED_P, MIRRORED_Q = (-0.5, 1.0, -2.0), (0.0, -0.6, 0.0, 0.8)


@pytest.mark.parametrize(
    ("datagrams", "key", "p", "q", "tracked"),
    [
        ([pose(7)], 7, P, Q, True),
        ([pose("left_wrist")], "left_wrist", P, Q, True),
        ([body(7, "position", *P), body(7, "quat", *Q)], 7, P, Q, True),
        ([body(7, "quat", *Q), body(7, "tracked", 1), body(7, "position", *P)], 7, P, Q, True),
        ([pose(7), body(7, "tracked", 0)], 7, P, Q, False),
        ([pose(7), body(7, "tracked", False)], 7, P, Q, False),
        ([pose(7), body(7, "tracked", 1.0)], 7, P, Q, True),
        ([body(7, "tracked", 0)], 7, (0, 0, 0), (0, 0, 0, 1), False),
        ([osc("/rigidbody", 7, "transformation", *P, *Q)], 7, P, Q, True),
        ([osc("/rigidbody", 7, "position", *P), osc("/rigidbody", 7, "quat", *Q)], 7, P, Q, True),
        ([osc("/rigidbody", "Box", "transformation", *P, *Q)], "Box", P, Q, True),
        ([osc("/rigidbody", "12", "transformation", *P, *Q)], 12, P, Q, True),
        ([osc("/VMC/Ext/Tra/Pos", "LHR-1", *P, *Q)], "LHR-1", MIRRORED_P, MIRRORED_Q, True),
        ([osc("/VMC/Ext/Con/Pos", "LHR-1", *P, *Q)], "LHR-1", MIRRORED_P, MIRRORED_Q, True),
        ([osc("/VMC/Ext/Hmd/Pos/Local", "LHR-1", *P, *Q)], "LHR-1", MIRRORED_P, MIRRORED_Q, True),
        (
            [osc("/VMC/Ext/Tra/Pos/Local", "T", *P, *Q), osc("/VMC/Ext/Tra/Pos", "T", *(9.0,) * 7)],
            "T",
            MIRRORED_P,
            MIRRORED_Q,
            True,
        ),
        (
            [osc("/tracking/trackers/3/position", *P), osc("/tracking/trackers/3/rotation", 0.0, 90.0, 0.0)],
            3,
            MIRRORED_P,
            (0, -math.sqrt(0.5), 0, math.sqrt(0.5)),
            True,
        ),
        (
            [
                osc("/tracking/trackers/head/rotation", 0.0, 0.0, 0.0),
                osc("/tracking/trackers/head/position", *P),
            ],
            "head",
            MIRRORED_P,
            (0, 0, 0, 1),
            True,
        ),
    ],
)
def test_every_pattern_gives_its_pose(datagrams, key, p, q, tracked):
    for way in datagrams, [bundle(*datagrams)]:
        (frame,) = play(*way)
        (sample,) = frame.bodies
        assert (sample.id if isinstance(key, int) else sample.name) == key
        assert sample.p == pytest.approx(p, abs=1e-6)
        assert sample.q == pytest.approx(q, abs=1e-6)
        assert sample.tracked is tracked


@pytest.mark.parametrize(
    "datagram",
    [
        osc("/VMC/Ext/OK", 1),
        osc("/VMC/Ext/Bone/Pos", "Hips", *P, *Q),
        osc("/rigidbody/7/matrix", *(0.0,) * 16),
        osc("/rigidbody", 7, "matrix", *(0.0,) * 16),
        osc("/skeleton/joint", "Ann", 3, "quat", *Q),
        osc("/marker", 1, "position", *P),
        osc("/tracking/trackers/3/scale", 1.0),
        osc("/"),
    ],
)
def test_messages_with_other_addresses_are_ignored(datagram):
    frames, useful, faults = FrameAssembler("osc:test").add(split_packet(datagram), 0.0)
    assert not frames
    assert not useful
    assert not faults


@pytest.mark.parametrize(
    ("datagram", "expected"),
    [
        (body(7, "position", 1.0, 2.0), "2 arguments; it must have 3: x, y, z"),
        (body(7, "quat", 1.0, 2.0, 3.0, "w"), "the argument 'w'; it must be a number"),
        (osc("/VMC/Ext/Tra/Pos", *P, *Q), "7 arguments; it must have 8: body, x, y, z"),
        (osc("/VMC/Ext/Tra/Pos"), "0 arguments; it must have 8: body"),
        (osc("/rigidbody", 0.5, "transformation", *P, *Q), "must be a name or an integer"),
        (osc("/rigidbody/99999999999999999999/position", *P), "31 bits"),
        (osc("/rigidbody//position", *P), "printable"),
        (start(math.nan), "finite"),
        (stamp(math.inf), "finite"),
        (osc("/frame/start", "x"), "the argument 'x'; it must be a number"),
    ],
)
def test_wrong_messages_are_named_and_a_good_one_follows(datagram, expected):
    assembler = FrameAssembler("osc:test")
    frames, useful, faults = assembler.add(split_packet(datagram), 0.0)
    assert not frames
    assert not useful
    assert expected in faults[0]
    assert names(assembler.add(split_packet(bundle(pose(1), pose(2))), 0.1)[0]) == [[1, 2]]


@pytest.mark.parametrize(
    ("datagrams", "times", "expected"),
    [
        # marked, one datagram a message
        ([start(1), pose(1), pose(2), end(1), start(2), pose(1), end(2)], None, [(1, [1, 2]), (2, [1])]),
        # the end got lost: the next start ends it
        ([start(1), pose(1), start(2), pose(1), end(2)], None, [(1, [1]), (2, [1])]),
        # a doubled start does not tear the frame apart
        ([start(1), pose(1), start(1), pose(2), end(1)], None, [(1, [1, 2])]),
        # a doubled message in a marked frame does not either
        ([start(1), pose(1), pose(1), pose(2), end(1)], None, [(1, [1, 2])]),
        # everything in one bundle, frame after frame
        ([bundle(start(1), pose(1), pose(2), end(1)), bundle(start(2), end(2))], None, [(1, [1, 2])]),
        # a marked frame over two bundles
        ([bundle(start(1), pose(1), pose(2)), bundle(pose(3), pose(4), end(1))], None, [(1, [1, 2, 3, 4])]),
        # a bundle is a frame
        ([bundle(pose(1), pose(2)), bundle(pose(1), pose(2))], None, [(None, [1, 2])] * 2),
        # bundles of one message each are as good as loose
        ([bundle(pose(1)), bundle(pose(2)), bundle(pose(1))], None, [(None, [1, 2]), (None, [1])]),
        # bundles of one message each with time tags
        ([bundle(pose(n), tag=5 + n // 3) for n in (1, 2, 3)], None, [(None, [1, 2]), (None, [3])]),
        # loose: a repeated field begins a frame
        ([pose(1), pose(2), pose(1), pose(2)], None, [(None, [1, 2])] * 2),
        # loose: a repeated time stamp begins a frame
        ([stamp(1.0), pose(1), stamp(2.0), pose(2)], None, [(None, [1]), (None, [2])]),
        # loose: a gap ends a frame
        ([pose(1), pose(2), pose(3)], [0, 0.9 * GAP_S, 2 * GAP_S], [(None, [1, 2]), (None, [3])]),
        # marked: only a long gap does
        ([start(1), pose(1), pose(2), end(1)], [0, 0.01, 0.03, 0.04], [(1, [1, 2])]),
        (
            [start(1), pose(1), pose(2), end(1)],
            [0, 0, 2 * MARKED_GAP_S, 2 * MARKED_GAP_S],
            [(1, [1]), (1, [2])],
        ),
        # a body that lost a part of its pose is left out
        ([start(1), body(1, "position", *P), pose(2), end(1)], None, [(1, [2])]),
        # nothing of use, no frame
        ([start(1), stamp(1.0), end(1)], None, []),
        ([start(1), body(1, "quat", *Q), end(1)], None, []),
    ],
)
def test_grouping(datagrams, times, expected):
    frames = play(*datagrams, times=times)
    assert list(zip([frame.frame for frame in frames], names(frames), strict=True)) == expected


ntp = (NTP_TO_UNIX_S + 5 << 32) + (1 << 31)


@pytest.mark.parametrize(
    ("datagrams", "t_s"),
    [
        ([start(1), stamp(2_500.0), pose(1), end(1)], 2.5),
        ([start(1), stamp(("d", 8_640_000_000.125)), pose(1), end(1)], 8_640_000.000125),
        ([start(1), stamp(("h", 1234)), pose(1), end(1)], 1.234),
        ([bundle(pose(1), pose(2), tag=ntp)], 5.5),
        ([bundle(start(1), stamp(2_500.0), pose(1), end(1), tag=ntp)], 5.5),
        ([bundle(start(1), stamp(2_500.0), pose(1), end(1))], 2.5),
        ([start(1), pose(1), end(1)], 100.0),
        ([pose(1)], 100.0),
        ([bundle(pose(1), pose(2))], 100.0),
    ],
)
def test_time_of_a_frame(datagrams, t_s):
    (frame,) = play(*datagrams)
    assert frame.t_s == pytest.approx(t_s, abs=1e-9)


@pytest.mark.parametrize("rate_hz", [30, 120, 360])
def test_loose_frames_without_times_have_the_time_of_their_first_message(rate_hz):
    times = [n / rate_hz + late for n in range(20) for late in (0.0, 0.0002, 0.0004)]
    messages = [body(1, "position", *P), body(1, "quat", *Q), pose(2)] * 20
    frames = play(*messages, times=times)
    assert [frame.t_s for frame in frames] == pytest.approx([n / rate_hz for n in range(20)])
    assert [frame.t_received_s for frame in frames] == pytest.approx([n / rate_hz + 0.0004 for n in range(20)])


def test_a_frame_that_lost_its_time_stamp_is_dropped_and_counted():
    assembler = FrameAssembler("osc:test")
    whole = [start(1), stamp(1.0), pose(1), end(1)]
    for datagram in [*whole, start(2), pose(1), end(2), *whole]:
        assembler.add(split_packet(datagram), 50.0)
    assert assembler.incomplete == 1


def test_a_sender_that_stops_giving_times_is_accepted_after_a_while():
    assembler = FrameAssembler("osc:test")
    assembler.add(split_packet(bundle(stamp(1.0), pose(1))), 50.0)
    timeless = split_packet(bundle(pose(1), pose(2)))
    frames = [assembler.add(timeless, 51.0 + n)[0] for n in range(CLOCK_PATIENCE + 2)]
    assert [len(f) for f in frames] == [0] * CLOCK_PATIENCE + [1, 1]
    assert frames[-1][0].t_s == 51.0 + CLOCK_PATIENCE + 1


@pytest.mark.parametrize("jitter_s", [0.0, 0.006, 0.02])
def test_a_clock_that_stands_still_for_a_second_costs_few_frames(jitter_s):
    """From the datagrams to the timeline of an actor, without the load of this machine."""
    assembler, timeline, jitter = FrameAssembler("osc:test"), Timeline(0.1), random.Random(1)
    used, now_s, ms = 0, 100.0, 0
    for k in range(4 * HZ):
        now_s = max(now_s, 100.0 + k / HZ + jitter.uniform(0.0, jitter_s))
        ms = milliseconds(k) if not HZ <= k < 2 * HZ else ms
        datagram = bundle(stamp(ms), *(osc(f"/rigidbody/{i}/transformation", *p) for i, p in bodies(k)))
        for frame in assembler.add(split_packet(datagram), now_s).frames:
            found = {str(sample.id): np.array([*sample.p, *sample.q]) for sample in frame.bodies}
            used += timeline.push(frame.t_s, found, frame.t_received_s) is None
        while timeline.poll(now_s) is not None:
            pass
    assert used > 0.97 * 4 * HZ


def test_bodies_beyond_the_limit_are_dropped():
    assembler = FrameAssembler("osc:test")
    for n in range(MAX_BODIES + 5):
        assembler.add(split_packet(pose(n)), 0.0)
    (frame,) = assembler.flush(1.0)
    assert len(frame.bodies) == MAX_BODIES
    assert assembler.incomplete == 5


def axis(index, degrees):
    q = np.zeros(4)
    q[index], q[3] = math.sin(math.radians(degrees) / 2), math.cos(math.radians(degrees) / 2)
    return q


@given(st.tuples(*[st.floats(-180, 180)] * 3))
def test_unity_euler_angles_turn_about_z_then_x_then_y(angles):
    left_handed = quat_multiply(axis(1, angles[1]), quat_multiply(axis(0, angles[0]), axis(2, angles[2])))
    mirror = np.diag([-1.0, 1.0, 1.0])
    expected = mirror @ quat_to_matrix(left_handed) @ mirror
    assert quat_to_matrix(np.array(UNITY.euler(angles))) == pytest.approx(expected, abs=1e-9)


def test_a_rotation_in_unity_that_is_checked_by_eye():
    # Unity: +90 degrees about y turns forward (+z) to the right (+x). Right is -x in our frame.
    turn = quat_to_matrix(np.array(UNITY.euler((0.0, 90.0, 0.0))))
    assert turn @ [0, 0, 1] == pytest.approx([-1, 0, 0], abs=1e-12)


def test_nan_in_a_pose_is_the_fault_of_one_body():
    (frame,) = play(bundle(body(1, "transformation", *P, math.nan, *Q[1:]), pose(2)))
    assert [sample.fault for sample in frame.bodies] == ["nan", None]


def test_a_large_bundle_is_read_whole():
    (frame,) = play(bundle(start(1), *[pose(n) for n in range(250)], end(1)))
    assert len(frame.bodies) == 250
