"""What is performed while things go wrong: a real take where `MANIPNET_DATA` names the dataset, else the demo."""

import json
import os
from collections.abc import Iterator
from pathlib import Path

from manipnet.demo.player import DEMO_FILE, DEMO_OBJECTS
from manipnet.recording.mcap_file import RecordingWriter
from manipnet.synthesis.objects.library import LIBRARY_FOLDER
from manipnet.synthesis.objects.shape import load_shape
from manipnet.wire.bodies import BodyFrame
from manipnet_tools.bench.scenarios import Performance, actor_config, actor_names, endless
from manipnet_tools.commands.replay import resample, take_frames
from manipnet_tools.takes.take import read_take

TAKE, PROP = "mug1", "mug1"


def motion(rate_hz: float) -> Performance:
    """The performance at `rate_hz`; `frames(performance, …)` makes it endless."""
    data = os.environ.get("MANIPNET_DATA")
    path, meshes = DEMO_FILE, {name: LIBRARY_FOLDER / f"{name}.ply" for name in DEMO_OBJECTS}
    take = read_take(Path(data) / "BVH" / TAKE if data else path)
    if data:
        meshes = dict.fromkeys(take.objects, Path(data) / "meshes" / f"{PROP}.obj")
    take = resample(take, rate_hz)
    shapes = {name: load_shape(mesh) for name, mesh in meshes.items()}
    return Performance(take.name, rate_hz, list(take_frames(take)), meshes, shapes)


def frames(performance: Performance, seconds: float, actors: int = 1) -> Iterator[BodyFrame]:
    """The first `seconds`, forth and back as often as needed, every actor ahead of the one before."""
    for frame in endless(performance, actors):
        if frame.t_s > seconds:
            return
        yield frame


def recording(performance: Performance, folder: Path) -> Path:
    """The performance forth and back, so that it can be looped, as a file that is read in no time."""
    path = folder / "motion.mcap"
    with RecordingWriter(path, {}) as writer:
        for frame in frames(performance, 2.0 * (len(performance.frames) - 1) / performance.rate_hz - 1e-6):
            writer.write_bodies(frame, round(1e9 * frame.t_s))
    return path


def rig_file(performance: Performance, actors: int, folder: Path) -> Path:
    """A rig file for `actors` performers as `frames` names their bodies."""
    lines: list[str] = []
    for name in actor_names(actors):
        config = actor_config(performance, name, actors)
        lines += ["[[actors]]", f"name = {json.dumps(name)}"]
        lines += [f"bodies.{wrist} = {json.dumps(body.key)}" for wrist, body in config.wrists.items()]
        for thing in config.objects:
            lines += ["[[actors.objects]]", f"name = {json.dumps(thing.name)}", f"body = {json.dumps(thing.body.key)}"]
            lines += [f"mesh = {json.dumps(str(thing.mesh.resolve()))}"]
    path = folder / "rig.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
