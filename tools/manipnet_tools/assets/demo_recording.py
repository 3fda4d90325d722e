"""Generate the demo recording that the server plays: `python -m manipnet_tools.assets.demo_recording`.

Two hands at a table (y = 0) reach for a cube, a cylinder and a mug of the library, lift and turn them, hand them over,
put them back, and end where they began. Every pose is made here; the pose of a hand relative to a held object, the
height at which it rests and its speed were measured on captured takes.
"""

from collections.abc import Iterator

import numpy as np

from manipnet.demo.player import DEMO_FILE
from manipnet.geometry import Side
from manipnet.recording.mcap_file import RecordingWriter
from manipnet.wire.bodies import BodyFrame, BodySample
from manipnet_tools.assets.choreography import Grasp, Rest, hand_pose, object_pose, perform
from manipnet_tools.assets.minimum_jerk import Move
from manipnet_tools.takes.take import BodyTrack, Take

RATE_HZ = 120
LENGTH_S = 44.0

IDLE = hand_pose((-0.25, 0.04, -0.95), (-0.35, -0.93, -0.05), (0.20, 0.045, 0.30))
HOMES = {
    "cube": object_pose((-0.17, 0.03, 0.02)),
    "cylinder": object_pose((0.0, 0.04, -0.08)),
    "mug": object_pose((0.19, 0.0475, 0.0), yaw=-100.0),
}

FROM_THE_SIDE = {"fingers": (-0.55, 0.12, -0.82), "palm": (-0.80, -0.38, 0.45)}
FROM_ABOVE = {"fingers": (-0.30, -0.25, -0.92), "palm": (-0.30, -0.92, 0.15)}

MOVES = {
    "cube": [
        Move(2.6, 3.8, object_pose((-0.06, 0.20, 0.06))),
        Move(3.5, 4.7, object_pose((-0.05, 0.21, 0.07), yaw=60.0)),
        Move(4.5, 5.7, object_pose((-0.02, 0.20, 0.07), yaw=60.0, pitch=15.0)),
        Move(7.0, 8.2, object_pose((0.08, 0.23, 0.06), yaw=35.0, pitch=-10.0)),
        Move(7.9, 9.0, object_pose((0.07, 0.21, 0.06), yaw=50.0, pitch=20.0)),
        Move(8.8, 10.0, object_pose((0.05, 0.05, 0.06), yaw=30.0)),
        Move(9.7, 10.3, object_pose((0.05, 0.03, 0.06), yaw=30.0)),
        Move(12.1, 13.1, object_pose((-0.06, 0.13, 0.05), yaw=15.0)),
        Move(12.7, 13.7, HOMES["cube"]),
    ],
    "cylinder": [
        Move(16.2, 17.4, object_pose((0.05, 0.20, 0.06))),
        Move(17.1, 18.4, object_pose((0.03, 0.22, 0.06), roll=65.0)),
        Move(18.3, 19.6, object_pose((0.02, 0.20, 0.07))),
        Move(21.4, 22.6, object_pose((-0.07, 0.22, 0.05), roll=-35.0)),
        Move(22.4, 23.5, object_pose((-0.05, 0.20, 0.05), yaw=40.0)),
        Move(23.3, 24.5, object_pose((0.0, 0.08, -0.07))),
        Move(24.1, 24.9, HOMES["cylinder"]),
    ],
    "mug": [
        Move(27.7, 28.9, object_pose((0.08, 0.18, 0.08), yaw=-100.0)),
        Move(28.6, 29.8, object_pose((0.06, 0.19, 0.09), yaw=-90.0, pitch=20.0)),
        Move(29.6, 30.6, object_pose((0.04, 0.18, 0.09), yaw=-90.0)),
        Move(31.8, 33.0, object_pose((0.0, 0.31, 0.14), yaw=-90.0)),
        Move(32.7, 33.9, object_pose((0.0, 0.33, 0.15), yaw=-90.0, pitch=40.0)),
        Move(34.4, 35.6, object_pose((0.0, 0.30, 0.13), yaw=-90.0)),
        Move(35.4, 36.6, object_pose((0.0, 0.18, 0.08), yaw=-70.0)),
        Move(36.4, 37.4, object_pose((0.02, 0.18, 0.08), yaw=-110.0)),
        Move(38.4, 39.6, object_pose((0.14, 0.13, 0.04), yaw=-90.0)),
        Move(39.2, 40.4, HOMES["mug"]),
    ],
}
HANDS: dict[Side, list[Rest | Grasp]] = {
    "left": [
        Rest(0.0, 1.0, IDLE),
        Grasp(2.2, 7.0, "cube", **FROM_ABOVE),
        Rest(8.3, 10.5, IDLE),
        Grasp(11.7, 14.1, "cube", **FROM_ABOVE),
        Rest(15.4, 18.6, IDLE),
        Grasp(20.3, 25.3, "cylinder", **FROM_ABOVE, at=(0.0, 0.015, 0.0)),
        Rest(26.6, 29.6, IDLE),
        Grasp(31.1, 38.0, "mug", **FROM_THE_SIDE),
        Rest(39.4, LENGTH_S, IDLE),
    ],
    "right": [
        Rest(0.0, 4.6, IDLE),
        Grasp(6.2, 10.7, "cube", **FROM_THE_SIDE),
        Rest(12.0, 14.5, IDLE),
        Grasp(15.8, 21.2, "cylinder", **FROM_THE_SIDE, at=(0.0, 0.01, 0.0)),
        Rest(22.6, 26.0, IDLE),
        Grasp(27.3, 40.8, "mug", **FROM_THE_SIDE, at=(0.0, 0.012, 0.0)),
        Rest(42.1, LENGTH_S, IDLE),
    ],
}


def demo_take() -> Take:
    """The scene at 120 Hz; its first frame can follow its last one."""
    time_s = np.arange(round(LENGTH_S * RATE_HZ)) / RATE_HZ
    seen = np.ones(len(time_s), dtype=np.bool_)
    tracks = perform(time_s, HOMES, MOVES, HANDS)
    return Take("demo", float(RATE_HZ), time_s, {name: BodyTrack(track, seen) for name, track in tracks.items()})


def demo_frames() -> Iterator[BodyFrame]:
    """The scene as a tracker would stream it, rounded to a hundredth of a millimetre."""
    take = demo_take()
    for k, t_s in enumerate(take.time_s):
        bodies = tuple(
            BodySample(
                None,
                name,
                tuple(np.round(track.poses[k, :3], 5).tolist()),
                tuple(np.round(track.poses[k, 3:], 6).tolist()),
                True,
            )
            for name, track in take.bodies.items()
        )
        yield BodyFrame(float(t_s), k, bodies, float(t_s), "demo")


def main() -> None:
    """Replace the recording in the package."""
    DEMO_FILE.unlink(missing_ok=True)
    with RecordingWriter(DEMO_FILE, {}) as writer:
        for frame in demo_frames():
            writer.write_bodies(frame, round(frame.t_s * 1e9))
    print(f"{DEMO_FILE}: {DEMO_FILE.stat().st_size} bytes")


if __name__ == "__main__":
    main()
