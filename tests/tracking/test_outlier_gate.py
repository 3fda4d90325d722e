"""The outlier gate rejects what no body can do, and nothing else, on made-up motion and on real takes."""

import itertools
import math
import random

import natnet_capture
import pytest

from manipnet.inputs.natnet.frames import read_frame
from manipnet.telemetry import BODY_REASONS
from manipnet.tracking.outlier_gate import MAX_BODIES, OutlierGate
from manipnet.tracking.outliers import CONFIRM_S, FORGET_S, FROZEN_S
from manipnet.wire.bodies import BodyFrame, BodySample
from manipnet_tools.takes.take import read_take

HZ = 120
UNTURNED = (0.0, 0.0, 0.0, 1.0)


def turned(degrees):
    half = math.radians(degrees) / 2
    return (math.sin(half), 0.0, 0.0, math.cos(half))


def frame(t_s, *bodies, source="test"):
    """Bodies as `(name, p)` or `(name, p, q)`."""
    samples = [BodySample(None, name, p, q[0] if q else UNTURNED, True) for name, p, *q in bodies]
    return BodyFrame(t_s, None, tuple(samples), t_s, source)


def faults(gate, frames):
    """`[fault of the first body, …]` of each frame."""
    return [gate.check(f)[0].bodies[0].fault for f in frames]


def still(seconds, p=(1.0, 1.0, 0.0), start_s=0.0, q=UNTURNED, name="wrist"):
    return [frame(start_s + n / HZ, (name, p, q)) for n in range(round(seconds * HZ))]


def shaking(seconds, start_s=0.0, amplitude_m=1e-5):
    shake = random.Random(1)
    return [
        frame(start_s + n / HZ, ("wrist", (1.0 + shake.uniform(-amplitude_m, amplitude_m), 1.0, 0.0)))
        for n in range(round(seconds * HZ))
    ]


def test_a_frame_without_fault_is_passed_on_unchanged():
    one = frame(0.0, ("wrist", (0.0, 1.0, 0.0)))
    assert OutlierGate().check(one) == (one, [])


@pytest.mark.parametrize("speed_m_s", [0.1, 5.0, 15.0])
@pytest.mark.parametrize("rate_hz", [30, 120, 360])
def test_fast_motion_is_not_a_jump(speed_m_s, rate_hz):
    gate = OutlierGate()
    motion = [
        frame(n / rate_hz, ("wrist", (speed_m_s * n / rate_hz, 1, 0), turned(20 * 57 * n / rate_hz)))
        for n in range(rate_hz)
    ]
    assert set(faults(gate, motion)) == {None}


def test_lost_frames_allow_a_longer_step():
    gate = OutlierGate()
    assert faults(gate, [frame(0.0, ("wrist", (0, 1, 0))), frame(0.2, ("wrist", (2.0, 1, 0)))]) == [None, None]


@pytest.mark.parametrize(
    ("p", "q"), [((1.0, 1.5, 0.0), UNTURNED), ((1.0, 1.0, 0.0), turned(120)), ((9.0, 9.0, 9.0), turned(180))]
)
def test_one_wild_sample_is_rejected(p, q):
    gate = OutlierGate()
    before, wild, after = still(0.1), frame(0.1, ("wrist", p, q)), still(0.1, start_s=0.1 + 1 / HZ)
    assert faults(gate, [*before, wild, *after]) == [None] * 12 + ["jump"] + [None] * 12


def test_a_body_that_stays_where_it_jumped_to_is_accepted_after_a_while():
    gate = OutlierGate()
    faults(gate, still(0.1))
    result = faults(gate, still(0.5, p=(3.0, 1.0, 0.0), start_s=0.1))
    held = round(CONFIRM_S * HZ)
    assert result == ["jump"] * held + [None] * (len(result) - held)


def test_wild_samples_in_many_places_are_never_accepted():
    gate = OutlierGate()
    faults(gate, still(0.1))
    wild = [frame(0.1 + n / HZ, ("wrist", (50.0 * (n % 7) + 50, 1, 0))) for n in range(round((FORGET_S - 0.1) * HZ))]
    assert set(faults(gate, wild)) == {"jump"}


def test_after_a_long_loss_a_body_is_accepted_where_it_appears():
    gate = OutlierGate()
    assert faults(gate, [*still(0.1), frame(5.0, ("wrist", (4.0, 1, 0)))])[-1] is None


def test_a_body_of_a_restarted_sender_is_accepted_where_it_appears():
    gate = OutlierGate()
    faults(gate, still(0.5, start_s=100.0))
    assert faults(gate, [frame(0.0, ("wrist", (4.0, 1, 0)))]) == [None]


def test_a_late_frame_is_judged_by_its_distance_in_time():
    gate = OutlierGate()
    path = {n: frame(n / HZ, ("wrist", (5.0 * n / HZ, 1, 0))) for n in range(12)}
    order = [0, 1, 2, 5, 3, 4, 8, 7, 6, 9, 11, 10]
    assert set(faults(gate, [path[n] for n in order])) == {None}


def test_two_swapped_bodies_are_rejected_until_they_swap_back():
    gate = OutlierGate()
    near, far = (0.0, 1.0, 0.0), (0.1, 1.0, 0.0)

    def pair(n, left, right):
        return frame(n / HZ, ("left", left), ("right", right))

    for n in range(12):
        assert not gate.check(pair(n, near, far))[1]
    assert gate.check(pair(12, far, near))[1] == ["swap", "swap"]
    assert gate.check(pair(13, far, near))[1] == ["swap", "swap"]
    assert not gate.check(pair(14, near, far))[1]


def test_two_bodies_that_pass_each_other_do_not_swap():
    gate = OutlierGate()
    for n in range(HZ):
        x = 2.0 * (n / HZ - 0.5)
        assert not gate.check(frame(n / HZ, ("left", (x, 1.0, 0)), ("right", (-x, 1.02, 0))))[1]


def test_zeros_are_never_accepted_from_a_body_that_was_elsewhere():
    gate = OutlierGate()
    assert set(faults(gate, still(0.5))) == {None}
    assert set(faults(gate, still(5.0, p=(0.0, 0.0, 0.0), start_s=0.5))) == {"zeros"}
    assert faults(gate, still(0.1, start_s=5.5))[0] is None


def test_a_body_near_the_origin_may_be_at_the_origin():
    gate = OutlierGate()
    assert set(faults(gate, still(2.0, p=(0.0, 0.0, 0.0)))) == {None}


def moving(frames):
    """The same frames with a second body that moves."""
    others = [frame(f.t_s, ("other", (0.5 * math.sin(f.t_s), 2.0, 0.0))) for f in frames]
    return [f._replace(bodies=f.bodies + other.bodies) for f, other in zip(frames, others, strict=True)]


def test_a_tracked_body_that_freezes_is_rejected_until_it_moves_again():
    gate = OutlierGate()
    assert set(faults(gate, moving(shaking(1.0)))) == {None}
    frozen = faults(gate, moving(still(3.0, start_s=1.0)))
    assert frozen.index("frozen") == pytest.approx(FROZEN_S * HZ, abs=2)
    assert set(frozen[frozen.index("frozen") :]) == {"frozen"}
    assert set(faults(gate, moving(shaking(1.0, start_s=4.0)))) == {None}


@pytest.mark.parametrize("noise_m", [1e-5, 3e-4])
def test_a_body_that_freezes_while_it_moves_is_rejected(noise_m):
    """Its noise shows across the motion."""
    gate, shake = OutlierGate(), random.Random(1)
    places = [
        (0.5 * math.sin(3.0 * n / HZ), *(1.0 + shake.gauss(0.0, noise_m) for _ in range(2))) for n in range(2 * HZ)
    ]
    swing = [frame(n / HZ, ("wrist", place)) for n, place in enumerate(places)]
    assert set(faults(gate, moving(swing))) == {None}
    assert faults(gate, moving(still(2.0, places[-1], start_s=2.0)))[-1] == "frozen"


def test_a_computed_motion_that_is_rounded_may_stand_still():
    gate = OutlierGate()
    places = [tuple(round(v, 6) for v in (math.sin(n / HZ), 1.0 + 1e-7 * math.sin(n), n / HZ)) for n in range(3 * HZ)]
    swing = [frame(n / HZ, ("wrist", place)) for n, place in enumerate(places)]
    assert set(faults(gate, moving([*swing, *still(2.0, places[-1], start_s=3.0)]))) == {None}


def test_nothing_is_frozen_while_everything_stands_still():
    gate = OutlierGate()
    faults(gate, shaking(1.0))
    assert set(faults(gate, still(3.0, start_s=1.0))) == {None}


def test_a_frozen_real_body_is_rejected():
    gate = OutlierGate()
    frames = [read_frame(payload, (3, 0)) for payload in natnet_capture.frames()]
    live = [frame(f.timestamp_s, ("quad", f.bodies[0].p, f.bodies[0].q)) for f in frames]
    assert set(faults(gate, moving(live))) == {None}
    end_s, last = frames[-1].timestamp_s, frames[-1].bodies[0]
    assert faults(gate, moving(still(1.0, last.p, end_s + 1 / HZ, last.q, "quad")))[-1] == "frozen"


def test_a_computed_body_may_stand_still():
    gate = OutlierGate()
    glide = [frame(n / HZ, ("wrist", (0.5 - 0.5 * math.cos(n / HZ), 1.0, 0.0))) for n in range(4 * HZ)]
    assert set(faults(gate, moving([*glide, *still(3.0, glide[-1].bodies[0].p, 4.0)]))) == {None}


def test_faults_of_the_parser_are_counted():
    bad = BodySample(1, None, (0.0, 0.0, 0.0), UNTURNED, False, "nan")
    lost = BodySample(2, None, (0.0, 0.0, 0.0), UNTURNED, False)
    given = BodyFrame(0.0, None, (bad, lost), 0.0, "test")
    assert OutlierGate().check(given) == (given, ["nan"])


def test_senders_and_bodies_are_judged_separately():
    gate = OutlierGate()
    gate.check(frame(0.0, ("wrist", (0, 1, 0)), ("mug", (3, 1, 0))))
    assert not gate.check(frame(0.0, ("wrist", (9, 1, 0)), source="another"))[1]


def test_memory_is_bounded():
    gate = OutlierGate()
    for n in range(3 * MAX_BODIES):
        gate.check(frame(0.0, (f"body {n}", (0, 1, 0))))
    assert gate.known_bodies <= MAX_BODIES


def test_every_reason_is_a_label_of_the_counter():
    own = {"nan", "bounds", "zero_quaternion", "frozen", "jump", "swap", "zeros"}
    assert own | {"conflict"} == set(BODY_REASONS), "two bodies on one key are refused before the gate"


@pytest.mark.parametrize("rate_hz", [30, 120])
def test_nothing_is_rejected_in_real_takes(manipnet_data, rate_hz):
    for folder in sorted((manipnet_data / "BVH").iterdir()):
        take = read_take(folder)
        gate = OutlierGate()
        for i in range(0, len(take.time_s), round(take.rate_hz / rate_hz)):
            bodies = [
                (name, tuple(body.poses[i, :3].tolist()), tuple(body.poses[i, 3:].tolist()))
                for name, body in take.bodies.items()
            ]
            assert gate.check(frame(float(take.time_s[i]), *bodies))[1] == [], (folder.name, i)


def test_every_real_take_has_a_jump_when_two_bodies_swap_names(manipnet_data):
    take = read_take(next((manipnet_data / "BVH").iterdir()))
    gate = OutlierGate()
    names = list(take.bodies)
    for i, swap in itertools.product([100], [False, True]):
        order = names[::-1] if swap else names
        bodies = [
            (name, tuple(take.bodies[of].poses[i + swap, :3].tolist())) for name, of in zip(names, order, strict=True)
        ]
        reasons = gate.check(frame(float(take.time_s[i + swap]), *bodies))[1]
    assert len(reasons) == 2
