"""A hand comes and goes without a jump, always inside its limits, always finite."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from manipnet.actors.output_guard import MAX_SPEED_RAD_S, MAX_WRIST_RAD_S, NotFiniteError, OutputGuard
from manipnet.actors.transitions import HOLD_AFTER_S, REST_AFTER_S, PoseTransition, ShownHand, state_at_age
from manipnet.geometry import quat_exp, quat_log, quat_multiply
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.telemetry import Telemetry
from manipnet.tracking.tick import TICK_S
from manipnet.wire import State

HAND = shipped_hand()

REST = HAND.limits.mean(axis=1)
FIST = HAND.limits[:, 1].copy()
HERE = np.array([0.1, 1.0, 0.2, 0.0, 0.0, 0.0, 1.0])
THERE = np.concatenate([[0.6, 1.2, -0.3], quat_exp(np.array([0.0, 1.5, 0.3]))])


def transition() -> PoseTransition:
    return PoseTransition(REST, OutputGuard(HAND.limits, Telemetry()))


def run(
    hand: PoseTransition, ticks: int, state: State, angles, wrist, run: int = 0, prop: str = "mug"
) -> list[ShownHand]:
    shown = [hand.show(state, angles, wrist, run, prop, TICK_S) for _ in range(ticks)]
    return [each for each in shown if each is not None]


@pytest.mark.parametrize(
    ("age_s", "state"),
    [(0.0, "live"), (HOLD_AFTER_S, "live"), (0.11, "hold"), (REST_AFTER_S, "hold"), (0.51, "rest"), (np.inf, "rest")],
)
def test_the_state_follows_the_age_of_the_tracking(age_s: float, state: str) -> None:
    assert state_at_age(age_s) == state


def test_nothing_is_shown_before_a_wrist_was_tracked() -> None:
    assert transition().show("rest", None, None, 0, None, TICK_S) is None


def test_live_shows_what_was_synthesised_at_once() -> None:
    shown = run(transition(), 2, "live", FIST, HERE)[-1]
    assert np.array_equal(shown.angles, FIST)
    assert np.array_equal(shown.wrist, HERE)


def test_hold_keeps_fingers_and_wrist() -> None:
    hand = transition()
    run(hand, 5, "live", FIST, HERE)
    shown = run(hand, 10, "hold", None, None)[-1]
    assert np.array_equal(shown.angles, FIST)
    assert np.array_equal(shown.wrist, HERE)
    assert shown.state == "hold"


def test_hold_keeps_the_fingers_on_a_wrist_that_is_still_tracked() -> None:
    hand = transition()
    run(hand, 5, "live", FIST, HERE)
    shown = run(hand, 2, "hold", None, HERE + 0.01 * np.eye(7)[0])[-1]
    assert np.array_equal(shown.angles, FIST)
    assert shown.wrist[0] == pytest.approx(0.11)


def test_rest_eases_the_fingers_and_leaves_the_wrist() -> None:
    hand = transition()
    run(hand, 5, "live", FIST, HERE)
    eased = [np.abs(s.angles - REST).max() for s in run(hand, 90, "rest", None, None)]
    assert np.all(np.diff(eased) < 0.0)
    assert eased[-1] < 0.02
    assert hand.shown is not None
    assert np.array_equal(hand.shown.wrist, HERE)


def test_a_return_to_live_glides_for_a_fifth_of_a_second() -> None:
    hand = transition()
    run(hand, 5, "live", REST, HERE)
    run(hand, 60, "rest", None, None)
    back = run(hand, 12, "live", FIST, THERE)
    whole = np.abs(FIST - REST).max()
    steps = [np.abs(a.angles - b.angles).max() for a, b in pairwise(back)]
    assert max(steps) < 0.2 * whole
    assert np.abs(back[-1].angles - FIST).max() < 0.12 * whole
    assert np.linalg.norm(back[-1].wrist[:3] - THERE[:3]) < 0.12 * np.linalg.norm(HERE[:3] - THERE[:3])


@given(data=st.data())
@settings(max_examples=40, deadline=None)
def test_no_sequence_of_events_makes_a_hand_jump_leave_its_limits_or_become_infinite(data) -> None:
    hand = transition()
    low, high = HAND.limits.T
    (previous,) = run(hand, 1, "live", REST, HERE, -1)
    whole = (high - low).max()
    for i in range(data.draw(st.integers(1, 12))):
        state = data.draw(st.sampled_from(["live", "hold", "rest"]))
        angles = low + (high - low) * data.draw(st.floats(0.0, 1.0)) if state == "live" else None
        wrist = data.draw(st.sampled_from([HERE, THERE, None]))
        for shown in run(hand, data.draw(st.integers(1, 20)), state, angles, wrist, i, str(i)):
            assert np.isfinite(shown.angles).all()
            assert np.isfinite(shown.wrist).all()
            assert np.all((low <= shown.angles) & (shown.angles <= high))
            assert np.abs(shown.angles - previous.angles).max() < 0.15 * whole
            assert np.linalg.norm(shown.wrist[:3] - previous.wrist[:3]) < 0.15
            turn = quat_log(quat_multiply(shown.wrist[3:], previous.wrist[3:] * np.array([-1, -1, -1, 1])))
            assert np.linalg.norm(turn) < 0.3
            previous = shown


def test_a_pose_that_is_not_finite_is_refused_and_changes_nothing() -> None:
    hand = transition()
    before = run(hand, 3, "live", FIST, HERE)[-1]
    with pytest.raises(NotFiniteError):
        hand.show("live", np.where(np.arange(20) == 7, np.nan, FIST), HERE, 0, "mug", TICK_S)
    assert hand.shown is before


@pytest.mark.parametrize("wrist", [HERE * np.nan, np.append(HERE[:3], [np.inf, 0, 0, 1]), np.append(HERE[:3], 4 * [0])])
def test_a_wrist_that_is_not_a_pose_is_refused_and_changes_nothing(wrist) -> None:
    hand = transition()
    before = run(hand, 3, "live", FIST, HERE)[-1]
    with pytest.raises(NotFiniteError):
        hand.show("live", FIST, wrist, 0, "mug", TICK_S)
    assert hand.shown is before
    with pytest.raises(NotFiniteError):
        transition().show("live", FIST, wrist, 0, "mug", TICK_S)


@pytest.mark.parametrize("away", [THERE, np.concatenate([HERE[:3], quat_exp(np.array([0.0, 3.0, 0.0]))])])
def test_a_wrist_that_is_suddenly_elsewhere_is_followed_without_a_jump(away) -> None:
    hand = transition()
    shown = run(hand, 5, "live", FIST, HERE) + run(hand, 60, "live", FIST, away)
    for a, b in pairwise(shown):
        turn = quat_log(quat_multiply(b.wrist[3:], a.wrist[3:] * np.array([-1, -1, -1, 1])))
        assert np.linalg.norm(b.wrist[:3] - a.wrist[:3]) < 0.15
        assert np.linalg.norm(turn) < MAX_WRIST_RAD_S * TICK_S
    assert np.allclose(shown[-1].wrist, away, atol=1e-3)


def test_a_fast_wrist_is_shown_where_it_is() -> None:
    hand = transition()
    path = [HERE + np.array([0.3 * tick, 0, 0, 0, 0, 0, 0]) for tick in range(10)]  # 18 m/s
    assert all(np.array_equal(run(hand, 1, "live", FIST, wrist)[0].wrist, wrist) for wrist in path)


def test_the_first_pose_shown_is_inside_the_limits_too() -> None:
    (shown,) = run(transition(), 1, "live", FIST + 1.0, HERE)
    assert np.all(shown.angles <= FIST)


def test_angles_outside_the_limits_or_too_fast_are_clipped_and_counted() -> None:
    telemetry = Telemetry()
    hand = PoseTransition(REST, OutputGuard(HAND.limits, telemetry))
    run(hand, 1, "live", HAND.limits[:, 0], HERE)
    (shown,) = run(hand, 1, "live", FIST + 1.0, HERE)
    steps = shown.angles - HAND.limits[:, 0]
    assert steps.max() == pytest.approx(MAX_SPEED_RAD_S * TICK_S)
    assert np.all(shown.angles <= FIST)
    assert telemetry.counts()["output_guarded"] == {"limit": 1, "speed": 1}


def test_a_wrist_that_was_forecast_glides_to_where_it_is() -> None:
    hand = transition()
    run(hand, 5, "live", FIST, HERE)
    hand.show("live", FIST, HERE, 0, "mug", TICK_S, known=False)
    there = HERE + np.array([0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    shown = run(hand, 60, "live", FIST, there)
    ways = [each.wrist[0] - HERE[0] for each in shown]
    assert max(b - a for a, b in pairwise([0.0, *ways])) < 0.005
    assert ways[-1] == pytest.approx(0.02, abs=1e-4)
