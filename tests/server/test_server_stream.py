"""A real server over real sockets: every tick of a performance comes out once and complete, whatever else arrives."""

from itertools import pairwise

import numpy as np
import pytest
from live_server import Stage, Subscriber, scene

from manipnet.actors.output_guard import MAX_SPEED_RAD_S
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.tracking.tick import TICK_S
from manipnet.wire import TOPIC_BIN, HandsMessage

HAND = shipped_hand()


def assert_whole(stage: Stage, messages: list[HandsMessage], seconds: float) -> None:
    """Check for 60 messages per second of stream time, possible hands, and no jump."""
    assert len(messages) == round(seconds * 60) + 1
    assert np.allclose(np.diff([m.t_capture for m in messages]), TICK_S)
    assert all(b.seq == a.seq + 1 for a, b in pairwise(messages))
    low, high = HAND.limits.T
    for a, b in pairwise(messages):
        for side, hand in b.hands.items():
            assert np.all((low - 1e-6 <= hand.angles) & (hand.angles <= high + 1e-6))
            assert np.abs(hand.angles - a.hands[side].angles).max() <= MAX_SPEED_RAD_S * TICK_S + 1e-6


@pytest.mark.parametrize("rate_hz", [30.0, 75.0, 120.0])
def test_a_performance_comes_out_complete(stage: Stage, rate_hz: float) -> None:
    messages = stage.perform(1.2, scene, rate_hz)
    assert_whole(stage, messages, 1.2)
    for message in messages:
        assert (message.v, message.actor, message.look_ahead) == (1, "actor", 0.5)
        assert set(message.hands) == {"left", "right"}
        assert [body.name for body in message.bodies] == ["Box", "left_wrist", "right_wrist"]
        for hand in message.hands.values():
            assert (hand.object, hand.scale) == ("Box", 1.0)
    settled = messages[20:]
    assert {hand.state for m in settled for hand in m.hands.values()} == {"live"}
    for message in settled:
        truth = scene(message.t_capture - stage.start_s)
        assert np.allclose(message.hands["left"].wrist[:3], truth["left_wrist"][:3], atol=2e-3)
        assert np.allclose(message.hands["left"].joints[1, :3], message.hands["left"].wrist[:3])


def test_both_encodings_hold_the_same(stage: Stage) -> None:
    binary = Subscriber(stage.server.addresses["hands"], TOPIC_BIN)
    packed = {m.seq: m for m in stage.perform(0.6, scene)}
    shared = [(m, packed[m.seq]) for m in binary.until(stage.start_s + 0.6) if m.seq in packed]
    binary.close()
    assert len(shared) > 30
    for a, b in shared:
        assert (a.session, a.t_capture, a.t_publish) == (b.session, b.t_capture, b.t_publish)
        for side, hand in a.hands.items():
            assert np.allclose(hand.joints, b.hands[side].joints, atol=1e-5)
            assert np.allclose(hand.angles, b.hands[side].angles, atol=1e-5)


GARBAGE = {
    "noise": b"\xc1\x00\xff",
    "nothing": b"",
    "not a map": b"\x93\x01\x02\x03",
    "json that ends": b'{"t": 1.0, "bodies": [',
    "time of text": b'{"t": "noon", "bodies": []}',
    "no bodies": b'{"t": 1.0}',
    "a body without a name": b'{"t": 1.0, "bodies": [{"p": [0, 0, 0], "q": [0, 0, 0, 1]}]}',
    "huge": b'{"t": 1.0, "bodies": [' + b" " * 100_000 + b"]}",
}


@pytest.mark.parametrize("garbage", GARBAGE.values(), ids=GARBAGE)
def test_a_malformed_message_is_counted_and_the_stream_goes_on(stage: Stage, garbage: bytes) -> None:
    before = stage.counted("frames_dropped", "malformed") + stage.counted("frames_dropped", "oversized")

    def poses(t_s: float):
        if round(t_s * 120) == 10:
            stage.sender.send_raw(garbage)
        return scene(t_s)

    assert_whole(stage, stage.perform(0.3, poses), 0.3)
    assert stage.counted("frames_dropped", "malformed") + stage.counted("frames_dropped", "oversized") == before + 1


def test_a_frame_without_any_body_of_the_rig_is_counted(stage: Stage) -> None:
    before = stage.counted("frames_dropped", "unknown_body")
    assert_whole(stage, stage.perform(0.2, lambda t: scene(t)), 0.2)
    stage.sender.send(stage.start_s + 0.3, {"Teapot": (0, 0, 0, 0, 0, 0, 1), 77: (0, 0, 0, 0, 0, 0, 1)})
    stage.perform(0.1, scene)
    assert stage.counted("frames_dropped", "unknown_body") == before + 1


@pytest.mark.parametrize(
    ("fault", "pose"),
    [
        ("nan", (float("nan"), 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)),
        ("bounds", (1e9, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)),
        ("zero_quaternion", (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
        ("jump", (3.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)),
    ],
)
def test_an_impossible_pose_costs_one_sample_of_one_body(stage: Stage, fault: str, pose) -> None:
    before = stage.counted("bodies_rejected", fault)
    poses = lambda t: scene(t) | ({"left_wrist": pose} if 0.2 < t < 0.24 else {})  # noqa: E731
    messages = stage.perform(0.6, poses)
    assert_whole(stage, messages, 0.6)
    assert {hand.state for m in messages for hand in m.hands.values()} == {"live"}
    assert stage.counted("bodies_rejected", fault) > before


def test_a_wrist_that_vanishes_is_held_then_rests_and_comes_back(stage: Stage) -> None:
    messages = stage.perform(
        2.0, lambda t: {k: v for k, v in scene(t).items() if k != "left_wrist" or not 0.4 < t < 1.4}
    )
    assert_whole(stage, messages, 2.0)
    assert {m.hands["right"].state for m in messages} == {"live"}
    states = [m.hands["left"].state for m in messages]
    assert [state for i, state in enumerate(states) if i == 0 or states[i - 1] != state] == [
        "live",
        "hold",
        "rest",
        "live",
    ]
    assert states.index("hold") == pytest.approx((0.4 + 0.1) * 60, abs=2)
    assert states.index("rest") == pytest.approx((0.4 + 0.5) * 60, abs=2)
    steps = [np.linalg.norm(b.hands["left"].wrist[:3] - a.hands["left"].wrist[:3]) for a, b in pairwise(messages)]
    assert max(steps) < 0.02


def test_a_prop_that_is_not_tracked_leaves_the_hands_at_rest(stage: Stage) -> None:
    messages = stage.perform(1.5, lambda t: scene(t) | ({"Box": None} if t > 0.4 else {}))
    assert_whole(stage, messages, 1.5)
    last = messages[-1].hands["right"]
    assert (last.state, last.object) == ("rest", None)
    assert not next(body for body in messages[-1].bodies if body.name == "Box").tracked
    truth = scene(1.5)["right_wrist"]
    assert np.allclose(last.wrist[:3], truth[:3], atol=2e-3), "the wrist is still tracked"


def test_silence_never_stops_the_stream_and_a_restart_is_followed(stage: Stage) -> None:
    stage.perform(0.5, scene)
    silence = [stage.subscriber.next() for _ in range(60)]
    assert all(b.seq == a.seq + 1 for a, b in pairwise(silence))
    assert {hand.state for hand in silence[-1].hands.values()} == {"rest"}
    before = stage.counted("sender_restarts", "zmq")
    stage.start_s -= 5000.0  # the sender starts again: its time goes back
    messages = stage.perform(0.5, scene)
    stage.start_s += 5000.0
    assert_whole(stage, messages, 0.5)
    assert messages[0].seq > silence[-1].seq
    assert stage.counted("sender_restarts", "zmq") == before + 1
