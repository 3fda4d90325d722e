"""From the hands an actor shows to the message clients get."""

from collections.abc import Mapping

import numpy as np

from manipnet.actors.actor import Actor, ShownHand
from manipnet.actors.transitions import HOLD_AFTER_S
from manipnet.geometry import Side
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.openxr import pose_in_world
from manipnet.tracking.timeline import Tick
from manipnet.wire import BodyPose, HandPose, HandsMessage, Latency


def hands_message(
    session: str,
    actor: Actor,
    tick: Tick,
    hands: Mapping[Side, ShownHand],
    t_publish: float,
    latency: Latency,
) -> HandsMessage:
    """The message of one tick; takes the actor's next sequence number."""
    message = HandsMessage(
        session=session,
        actor=actor.config.name,
        seq=actor.seq,
        t_capture=tick.time_s,
        t_publish=t_publish,
        look_ahead=tick.look_ahead_s,
        hands=hand_poses(actor.hand, hands, actor.config.hand_scale),
        bodies=tuple(
            BodyPose(body.age_s <= HOLD_AFTER_S, body.pose, name) for name, body in sorted(tick.bodies.items())
        ),
        latency_ms=latency,
    )
    actor.seq += 1
    return message


def hand_poses(hand: Hand, hands: Mapping[Side, ShownHand], scale: float) -> dict[Side, HandPose]:
    """What is shown of each hand, with its joints in the world; `scale` is the hand's size over the model's."""
    if not hands:
        return {}
    shown = [one.shown for one in hands.values()]
    angles, wrists = np.array([one.angles for one in shown]), np.array([one.wrist for one in shown])
    local, joints = pose_in_world(hand, list(hands), angles, wrists, scale)
    return {
        side: HandPose(
            state=one.shown.state,
            object=one.prop,
            scale=scale,
            angles=one.shown.angles,
            rotations=local[i],
            wrist=one.shown.wrist,
            joints=joints[i],
        )
        for i, (side, one) in enumerate(hands.items())
    }
