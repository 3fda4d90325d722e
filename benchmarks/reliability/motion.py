"""The motion that is sent to the servers: a real take if `MANIPNET_DATA` names the dataset, else the demo."""

import json
import os
from collections.abc import Iterator
from pathlib import Path

from manipnet.demo.player import DEMO_FILE, DEMO_OBJECTS
from manipnet.recording.mcap_file import RecordingWriter
from manipnet.synthesis.objects.library import LIBRARY_FOLDER
from manipnet.synthesis.objects.shape import load_shape
from manipnet.wire.bodies import BodyFrame
from manipnet_tools.bench.scenarios import Scenario, actor_config, actor_names, endless
from manipnet_tools.commands.replay import resample, take_frames
from manipnet_tools.takes.take import read_take

TAKE, PROP = "mug1", "mug1"


def motion(rate_hz: float) -> Scenario:
    """The motion at `rate_hz`; `frames(scenario, …)` repeats it."""
    data = os.environ.get("MANIPNET_DATA")
    path, meshes = DEMO_FILE, {name: LIBRARY_FOLDER / f"{name}.ply" for name in DEMO_OBJECTS}
    take = read_take(Path(data) / "BVH" / TAKE if data else path)
    if data:
        meshes = dict.fromkeys(take.objects, Path(data) / "meshes" / f"{PROP}.obj")
    take = resample(take, rate_hz)
    shapes = {name: load_shape(mesh) for name, mesh in meshes.items()}
    return Scenario(take.name, rate_hz, list(take_frames(take)), meshes, shapes)


def mesh_options(scenario: Scenario) -> list[str]:
    """The server's options that name the meshes of the props."""
    return [f"--mesh={name}={path}" for name, path in scenario.meshes.items()]


def frames(scenario: Scenario, seconds: float, actors: int = 1) -> Iterator[BodyFrame]:
    """The first `seconds` of the motion, played forth and back; each actor is ahead of the previous one."""
    for frame in endless(scenario, actors):
        if frame.t_s > seconds:
            return
        yield frame


def recording(scenario: Scenario, folder: Path) -> Path:
    """Write a recording of the motion forth and back, which can be looped without a jump; returns its path."""
    path = folder / "motion.mcap"
    with RecordingWriter(path, {}) as writer:
        for frame in frames(scenario, 2.0 * (len(scenario.frames) - 1) / scenario.rate_hz - 1e-6):
            writer.write_bodies(frame, round(1e9 * frame.t_s))
    return path


def rig_file(scenario: Scenario, actors: int, folder: Path) -> Path:
    """Write a rig file for `actors` actors, with bodies named as `frames` names them; returns its path."""
    lines: list[str] = []
    for name in actor_names(actors):
        config = actor_config(scenario, name, actors)
        lines += ["[[actors]]", f"name = {json.dumps(name)}"]
        lines += [f"bodies.{wrist} = {json.dumps(body.key)}" for wrist, body in config.wrists.items()]
        for prop in config.objects:
            lines += ["[[actors.objects]]", f"name = {json.dumps(prop.name)}", f"body = {json.dumps(prop.body.key)}"]
            lines += [f"mesh = {json.dumps(str(prop.mesh.resolve()))}"]
    path = folder / "rig.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
