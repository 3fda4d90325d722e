"""From the hands that an actor shows to the message that clients receive."""

from collections.abc import Mapping

import numpy as np

from manipnet.actors.actor import Actor
from manipnet.actors.transitions import HOLD_AFTER_S, ShownHand
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.openxr import pose_in_world
from manipnet.tracking.tick import Tick
from manipnet.wire import BodyPose, HandPose, HandsMessage, Latency, Side


def hands_message(
    session: str,
    actor: Actor,
    tick: Tick,
    hands: Mapping[Side, ShownHand],
    t_publish: float,
    latency: Latency,
) -> HandsMessage:
    """The message of one tick; it takes the actor's next sequence number."""
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
    """What is shown of the model's `hand`, with its joints in the world; `scale` is its size relative to the model."""
    if not hands:
        return {}
    angles = np.array([shown.angles for shown in hands.values()])
    wrists = np.array([shown.wrist for shown in hands.values()])
    rotations, joints = pose_in_world(hand, list(hands), angles, wrists, scale)
    return {
        side: HandPose(
            state=shown.state,
            object=shown.prop,
            scale=scale,
            angles=shown.angles,
            rotations=rotations[i],
            wrist=shown.wrist,
            joints=joints[i],
        )
        for i, (side, shown) in enumerate(hands.items())
    }
