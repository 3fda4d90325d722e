"""`manipnet hand check`: synthesises a take, carries it onto a hand, and says how much contact is left."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from manipnet.geometry import SIDES
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.synthesizer import Synthesizer
from manipnet_tools.commands.synthesize import read_shapes
from manipnet_tools.hands.measures import carry_take, drop_shares, measure_hand
from manipnet_tools.takes.rollout import hand_inputs, held_objects, roll_out, tick_take
from manipnet_tools.takes.take import TakeError, read_take


def check_profile(
    profile: HandProfile, path: Path, meshes: Sequence[str], model: str, drop: bool = False
) -> Iterator[str]:
    """One line per hand, and one for the drop test. Raises `TakeError`, `MeshError` and `BundleError`."""
    take = read_take(path)
    shapes = read_shapes(meshes, take, path)
    if len(shapes) != 1:
        raise TakeError(f"{path}: a check is about one object; give one --mesh of {', '.join(shapes)}")
    ((name, shape),) = shapes.items()
    synthesizer, ticks = Synthesizer(load_bundle(model)), tick_take(take)
    inputs = hand_inputs(ticks, shapes)
    motions = dict(zip(inputs, roll_out(synthesizer, list(inputs.values())), strict=True))
    poses = ticks.bodies[name].poses
    own, avatar = {}, {}
    for side in SIDES:
        wrist, held = ticks.bodies[f"{side}_wrist"].poses, held_objects(ticks, shapes, inputs[side])
        own[side], avatar[side] = carry_take(synthesizer.hand, profile, side, motions[side].angles, wrist, held)
        found = measure_hand(own[side], avatar[side], shape, poses)
        yield (
            f"{take.name} {side}: {100 * found.kept:.1f} % of {found.touching} touching pads kept "
            f"({100 * found.capsules_kept:.1f} % by the last bones); penetration {found.penetration_cm[1]:.3f} cm "
            f"(model's hand {found.penetration_cm[0]:.3f}); smoothness {found.smoothness:.2f} times the model's; "
            f"wrist moved by {found.shift_mm[0]:.1f} mm, at most {found.shift_mm[1]:.1f}"
        )
    if drop:
        before, after, frames = drop_shares(own, avatar, shape, poses)
        yield f"{take.name}: held in {100 * after:.0f} % of {frames} drops (model's hands {100 * before:.0f} %)"
