"""`manipnet synthesize`: synthesises the fingers of a take offline, with the synthesis of the live server."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from rich.progress import Progress

from manipnet.config.settings import WRISTS
from manipnet.geometry import Array
from manipnet.synthesis.carrying import HandCarrier
from manipnet.synthesis.hand.avatar import avatar_hand
from manipnet.synthesis.hand.profile import HandProfile, read_profile
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.objects.mesh import ClosedMesh, closed_mesh
from manipnet.synthesis.objects.shape import Shape, build_shape
from manipnet.synthesis.synthesizer import Synthesizer, hand_to_world
from manipnet_tools.commands.options import SynthesizeOptions
from manipnet_tools.takes.meshes import MeshFile, named_files, recorded_meshes
from manipnet_tools.takes.rigged import RigText, read_rig, read_rigged
from manipnet_tools.takes.rollout import Ticks, hand_inputs, held_objects, roll_out, tick_take
from manipnet_tools.takes.take import Take, TakeError
from manipnet_tools.terminal import open_console


def run(options: SynthesizeOptions) -> None:
    """Synthesise and write.

    Raises `TakeError`, `ConfigError`, `MeshError`, `BundleError`, `ProfileError` and `OSError`.
    """
    console = open_console()
    with console.status("loading take, meshes and model"):
        rig = read_rig(options.rig, options.actor)
        rigged = read_rigged(options.take, rig, options.up)
        take = rigged.take
        shapes = read_shapes(options.mesh, take, options.take, rig)
        synthesizer = Synthesizer(load_bundle(options.model))
        profile = profile_of(options.hand, rig)
        ticks = tick_take(take, options.look_ahead)
    with Progress(console=console) as progress:
        task = progress.add_task(take.name, total=2 * len(ticks.time_s))
        hands = synthesise(synthesizer, ticks, shapes, lambda n: progress.advance(task, n), rigged.hand_scale, profile)
    with options.out.open("wb") as file:
        write_arrays(file, ticks, shapes, hands)
    console.print(f"wrote {options.out}: {len(ticks.time_s)} frames at 60 Hz, both hands")


def write_arrays(file: IO[bytes], ticks: Ticks, shapes: dict[str, Shape], hands: dict[str, Array]) -> None:
    """Write the result: `time`, the timecode, the arrays of `synthesise`, and the poses and mesh of every object."""
    objects = [name for name in ticks.bodies if not name.endswith("_wrist")]
    arrays: dict[str, Any] = {"time": ticks.time_s, **hands, "objects": np.array(objects)}
    arrays["object_poses"] = np.stack([ticks.bodies[name].poses for name in objects])
    for k, name in enumerate(objects):
        if name in shapes:
            arrays[f"object_{k}_vertices"] = shapes[name].mesh.vertices.astype(np.float32)
            arrays[f"object_{k}_faces"] = shapes[name].mesh.faces
    if ticks.timecode is not None:
        arrays |= ticks.timecode.arrays()
    np.savez_compressed(file, **arrays)


def profile_of(hand: Path | None, rig: RigText | None) -> HandProfile | None:
    """The avatar's hands: those of the file `hand`, or else of the rig. Raises `ProfileError`."""
    file = hand or (None if rig is None else rig.hand)
    return None if file is None else read_profile(file)


def read_shapes(meshes: Sequence[str], take: Take, path: Path, rig: RigText | None = None) -> dict[str, Shape]:
    """Shapes by body, from `meshes` (`NAME=FILE`), or else from the recording at `path`, or else from the rig.

    Raises `TakeError` and `MeshError`.
    """
    check_wrists(take)
    kept = recorded_meshes(path) if path.suffix.lower() == ".mcap" and not meshes else {}
    if shapes := {name: build_shape(mesh) for name, mesh in kept.items() if name in take.objects}:
        return shapes
    files = {name: MeshFile(file) for name, file in named_files(meshes, take.objects).items()}
    if not files and rig is not None:
        files = {name: file for name, file in rig.meshes.items() if name in take.objects}
    if not files:
        objects = ", ".join(take.objects) or "it has none"
        raise TakeError(f"no --mesh: at least one of the take's objects needs a mesh ({objects})")
    return {
        name: build_shape(_centred(file.load()) if take.box_centred else file.load()) for name, file in files.items()
    }


def check_wrists(take: Take) -> None:
    """Raise `TakeError` unless the take has both wrists."""
    if missing := [wrist for wrist in WRISTS if wrist not in take.bodies]:
        bodies = ", ".join(take.bodies) or "none"
        raise TakeError(
            f"{take.name}: no body {' and no '.join(missing)}; its bodies are {bodies}; rename them or give --rig"
        )


def _centred(mesh: ClosedMesh) -> ClosedMesh:
    """The mesh with its origin at the centre of its bounding box."""
    centre = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    return closed_mesh(mesh.vertices - centre, mesh.faces, mesh.name)


def synthesise(
    synthesizer: Synthesizer,
    ticks: Ticks,
    shapes: dict[str, Shape],
    advance: Callable[[int], None],
    hand_scale: float = 1.0,
    profile: HandProfile | None = None,
) -> dict[str, Array]:
    """World positions, rotations, distances and positions before inverse kinematics, named as in the file.

    With the `profile` of an avatar, its joints and radii too. Calls `advance` with the number of hand-ticks done since
    the last call.
    """
    inputs = hand_inputs(ticks, shapes, hand_scale)
    arrays: dict[str, Array] = {}
    for side, motion in zip(inputs, roll_out(synthesizer, list(inputs.values()), advance), strict=True):
        wrist = ticks.bodies[f"{side}_wrist"].poses
        arrays[f"{side}_positions"], arrays[f"{side}_rotations"] = hand_to_world(
            side, wrist, hand_scale * motion.positions, motion.rotations
        )
        arrays[f"{side}_distances"] = hand_scale * motion.distances
        raw_positions = hand_scale * motion.raw_positions
        arrays[f"{side}_raw_positions"], _ = hand_to_world(side, wrist, raw_positions, motion.rotations)
        if profile is not None:
            avatar = avatar_hand(profile.hands[side], side, synthesizer.hand)
            held = held_objects(ticks, shapes, inputs[side])
            carrier = HandCarrier(avatar, synthesizer.hand, side)
            poses = [carrier.step(*each, hand_scale) for each in zip(motion.angles, wrist, held, strict=True)]
            arrays[f"{side}_hand_joints"] = np.stack([pose.joints for pose in poses])
            arrays[f"{side}_hand_radii"] = avatar.radii
    return arrays
