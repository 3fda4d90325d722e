"""Publish the hands of two actors, grasping and waving, with a prop and a timecode; the line `ready` has the address.

Anna has both hands, Ben only the right one. Anna's timecode begins at 01:00:00:00 at 30 frames per second.
"""

import itertools
import time

import numpy as np
import zmq
from publisher import RATE_HZ

from manipnet.geometry import Side, quat_exp
from manipnet.synthesis.hand.openxr import pose_in_world
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.wire import TOPIC_BIN, BodyPose, HandPose, HandsMessage, encode_binary

HAND = shipped_hand()
TIMECODE_HZ = 30.0
CAST: tuple[tuple[str, tuple[Side, ...]], ...] = (("Anna", ("left", "right")), ("Ben", ("right",)))


def grasping(side: Side, t_s: float) -> HandPose:
    """A hand that opens and closes and is carried around."""
    low, high = HAND.limits.T
    share = 0.5 + 0.35 * np.sin(2.0 * t_s + np.arange(len(low)))
    angles = low + share * (high - low)
    x = (0.2 if side == "left" else -0.2) + 0.05 * np.sin(t_s)
    wrist = np.concatenate([[x, 1.2 + 0.05 * np.cos(t_s), 0.3], quat_exp(np.array([0.4 * np.sin(t_s), 0.3, 0.2]))])
    rotations, joints = pose_in_world(HAND, [side], angles[None], wrist[None], 1.0)
    return HandPose("live", "Box", 1.0, angles, rotations[0], wrist, joints[0])


def main() -> None:
    socket = zmq.Context.instance().socket(zmq.PUB)
    socket.setsockopt(zmq.LINGER, 0)
    port = socket.bind_to_random_port("tcp://127.0.0.1")
    print(f"ready tcp://127.0.0.1:{port} -", flush=True)
    start = time.monotonic()
    for seq in itertools.count():
        t_s = seq / RATE_HZ
        time.sleep(max(start + t_s - time.monotonic(), 0.0))
        counted = int(t_s * TIMECODE_HZ)
        timecode = f"01:{counted // 1800 % 60:02d}:{counted // 30 % 60:02d}:{counted % 30:02d}"
        box = BodyPose(True, np.array([0.1 * np.sin(t_s), 1.0, 0.2, *quat_exp(np.array([0.0, t_s % 3.0, 0.0]))]), "Box")
        for actor, sides in CAST:
            hands: dict[Side, HandPose] = {side: grasping(side, t_s) for side in sides}
            extra = (timecode, TIMECODE_HZ) if actor == "Anna" else (None, None)
            message = HandsMessage(
                "s", actor, seq, t_s, time.monotonic(), 0.5, hands, (box,), timecode=extra[0], timecode_rate=extra[1]
            )
            socket.send(TOPIC_BIN + encode_binary(message))


if __name__ == "__main__":
    main()
