"""Body samples and frames as receivers make them, and recordings of them."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from live_server import Bodies, scene

from manipnet.recording.mcap_file import RecordingWriter
from manipnet.wire.bodies import BodyFrame, BodySample

RATE_HZ = 120
ORIGIN = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def sample(key: str | int, pose: Sequence[float] | np.ndarray | None) -> BodySample:
    """The body of a name or an id at a pose `(7,)`; None is a body that is not tracked."""
    x, y, z, qx, qy, qz, qw = map(float, ORIGIN if pose is None else pose)
    number, name = (key, None) if isinstance(key, int) else (None, key)
    return BodySample(number, name, (x, y, z), (qx, qy, qz, qw), pose is not None)


def frame(t_s: float, poses: Bodies, number: int | None = None, source: str = "zmq:test") -> BodyFrame:
    """A frame of poses `(7,)` by name or id, received at its own time."""
    return BodyFrame(t_s, number, tuple(sample(key, pose) for key, pose in poses.items()), t_s, source)


def record_scene(
    path: Path,
    seconds: float,
    meshes: dict[str, bytes] | None = None,
    names: Mapping[str, str] | None = None,
    start_s: float = 0.0,
) -> Path:
    """Record what a tracker sends during `scene`; `names` renames bodies."""
    names = names or {}
    path.parent.mkdir(parents=True, exist_ok=True)
    with RecordingWriter(path, {}, meshes) as writer:
        for k in range(round(seconds * RATE_HZ) + 1):
            poses = {names.get(name, name): pose for name, pose in scene(k / RATE_HZ).items()}
            writer.write_bodies(frame(start_s + k / RATE_HZ, poses, k), k * 1_000_000_000 // RATE_HZ)
    return path
