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
    timecode, timecode_rate = actor.timecode(tick.time_s)
    message = HandsMessage(
        session=session,
        actor=actor.config.name,
        seq=actor.seq,
        t_capture=tick.time_s,
        t_publish=t_publish,
        look_ahead=tick.look_ahead_s,
        hands=hand_poses(actor.model_hand, hands, actor.config.hand_scale),
        bodies=tuple(
            BodyPose(body.age_s <= HOLD_AFTER_S, body.pose, name) for name, body in sorted(tick.bodies.items())
        ),
        latency_ms=latency,
        timecode=timecode,
        timecode_rate=timecode_rate,
    )
    actor.seq += 1
    return message


def hand_poses(model: Hand, hands: Mapping[Side, ShownHand], scale: float) -> dict[Side, HandPose]:
    """Each hand with its joints in the world; `scale` is the size of the hands relative to the `model` hand's."""
    if not hands:
        return {}
    angles = np.array([hand.angles for hand in hands.values()])
    wrists = np.array([hand.wrist for hand in hands.values()])
    rotations, joints = pose_in_world(model, list(hands), angles, wrists, scale)
    return {
        side: HandPose(
            state=hand.state,
            object=hand.prop,
            scale=scale,
            angles=hand.angles,
            rotations=rotations[i],
            wrist=hand.wrist,
            joints=joints[i],
        )
        for i, (side, hand) in enumerate(hands.items())
    }
