"""From the hands an actor shows to the message clients get."""

from collections.abc import Mapping

import numpy as np

from manipnet.actor import Actor, ShownHand
from manipnet.geometry import Array, matrix_to_quat, mirror_points, mirror_quats, quat_conjugate, quat_multiply
from manipnet.hand.joint_sets import openxr_joints
from manipnet.hand.kinematics import forward_kinematics
from manipnet.hand.skeleton import BONE_COUNT, PARENTS
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
    positions, rotations = forward_kinematics(np.stack([hand.shown.angles for hand in hands.values()]))
    quats = matrix_to_quat(rotations)
    return {
        side: _hand_pose(side, hand, positions[i] * scale, quats[i], scale)
        for i, (side, hand) in enumerate(hands.items())
    }


def _hand_pose(side: Side, hand: ShownHand, positions: Array, quats: Array, scale: float) -> HandPose:
    """`positions (22, 3)` and `quats (17, 4)` are a right hand's, in its wrist frame."""
    if side == "left":
        positions, quats = mirror_points(positions), mirror_quats(quats)
    local = np.concatenate([quats[:1], quat_multiply(quat_conjugate(quats[PARENTS[1:BONE_COUNT]]), quats[1:])])
    shown = hand.shown
    return HandPose(
        state=shown.state,
        object=hand.prop,
        scale=scale,
        angles=shown.angles,
        rotations=local,
        wrist=shown.wrist,
        joints=openxr_joints(side, shown.wrist, positions, quats),
    )
