"""From the hands that an actor shows to the message that clients receive."""

from collections.abc import Mapping

import numpy as np

from manipnet.actors.actor import Actor
from manipnet.actors.soundness import are_sound
from manipnet.actors.transitions import HOLD_AFTER_S, ShownHand
from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.openxr import place_in_world
from manipnet.tracking.tick import Tick
from manipnet.wire import BodyPose, HandPose, HandsMessage, Latency, Side
from manipnet.wire.numbers import (
    HAND_COLUMNS,
    HAND_NUMBERS,
    LATENCIES,
    TIMES,
    allocate_numbers,
    hand_arrays,
    hand_rows,
    quaternion_places,
)
from manipnet.wire.validation import MAX_NUMBER, UNIT_TOLERANCE


def hands_message(
    session: str,
    actor: Actor,
    tick: Tick,
    hands: Mapping[Side, ShownHand],
    t_publish: float,
    latency: Latency,
) -> HandsMessage:
    """The message of one tick; it takes the actor's next sequence number."""
    timecode, timecode_rate = actor.timecode(tick.time_s)
    bodies = sorted(tick.bodies.items())
    numbers = allocate_numbers(len(hands), len(bodies))
    numbers[:TIMES] = tick.time_s, t_publish, tick.look_ahead_s
    poses = _put_hands(actor.model_hand, hands, actor.config.hand_scale, hand_rows(numbers, len(hands)))
    ends = [*(body.pose for _, body in bodies), [getattr(latency, name) for name in LATENCIES]]
    np.concatenate(ends, out=numbers[TIMES + len(hands) * HAND_NUMBERS :])
    message = HandsMessage(
        session=session,
        actor=actor.config.name,
        seq=actor.seq,
        t_capture=tick.time_s,
        t_publish=t_publish,
        look_ahead=tick.look_ahead_s,
        hands=poses,
        bodies=tuple(BodyPose(body.age_s <= HOLD_AFTER_S, body.pose, name) for name, body in bodies),
        latency_ms=latency,
        timecode=timecode,
        timecode_rate=timecode_rate,
    )
    actor.seq += 1
    sound = are_sound(numbers, quaternion_places(message), MAX_NUMBER, UNIT_TOLERANCE)
    return message.with_sound(numbers) if sound else message


def hand_poses(model: Hand, hands: Mapping[Side, ShownHand], scale: float) -> dict[Side, HandPose]:
    """Each hand with its joints in the world; `scale` is the size of the hands relative to the `model` hand's."""
    return _put_hands(model, hands, scale, np.empty((len(hands), HAND_NUMBERS)))


def _put_hands(model: Hand, hands: Mapping[Side, ShownHand], scale: float, rows: Array) -> dict[Side, HandPose]:
    """The hands, whose arrays are in `rows (N, HAND_NUMBERS)`."""
    if not hands:
        return {}
    given = hand_arrays(rows)
    for i, hand in enumerate(hands.values()):
        rows[i, 0], given.angles[i], given.wrist[i] = scale, hand.angles, hand.wrist
    place_in_world(model, list(hands), HAND_COLUMNS, rows)
    return {
        side: HandPose(hand.state, hand.prop, scale, *arrays)
        for (side, hand), arrays in zip(hands.items(), zip(*given, strict=True), strict=True)
    }
