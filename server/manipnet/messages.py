"""From the hands an actor shows to the message clients get."""

from collections.abc import Mapping

import numpy as np

from manipnet.actor import Actor, ShownHand
from manipnet.hand.joint_sets import pose_in_world
from manipnet.presence import HOLD_AFTER_S
from manipnet.streams.wire import BodyPose, HandPose, HandsMessage, Latency
from manipnet.synthesis import Side
from manipnet.timeline import Tick


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
        hands=hand_poses(hands, actor.config.hand_scale),
        bodies=tuple(
            BodyPose(body.age_s <= HOLD_AFTER_S, body.pose, name) for name, body in sorted(tick.bodies.items())
        ),
        latency_ms=latency,
    )
    actor.seq += 1
    return message


def hand_poses(hands: Mapping[Side, ShownHand], scale: float) -> dict[Side, HandPose]:
    """What is shown of each hand, with its joints in the world; `scale` is the hand's size over the model's."""
    if not hands:
        return {}
    shown = [hand.shown for hand in hands.values()]
    angles, wrists = np.array([hand.angles for hand in shown]), np.array([hand.wrist for hand in shown])
    local, joints = pose_in_world(list(hands), angles, wrists, scale)
    return {
        side: HandPose(
            state=hand.shown.state,
            object=hand.prop,
            scale=scale,
            angles=hand.shown.angles,
            rotations=local[i],
            wrist=hand.shown.wrist,
            joints=joints[i],
        )
        for i, (side, hand) in enumerate(hands.items())
    }
