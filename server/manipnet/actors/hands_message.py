"""From the hands an actor shows to the message clients get."""

from collections.abc import Mapping

import numpy as np

from manipnet.actors.actor import Actor, ShownHand
from manipnet.actors.transitions import HOLD_AFTER_S
from manipnet.synthesis.hand.openxr import pose_in_world
from manipnet.synthesis.synthesizer import Side
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
