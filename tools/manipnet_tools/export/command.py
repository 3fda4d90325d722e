"""`manipnet export`: writes hands and objects for other programs."""

from dataclasses import replace

from manipnet.synthesis.hand.profile import read_profile
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.mesh import load_mesh
from manipnet_tools.commands.options import RIG_SUFFIXES, ExportOptions
from manipnet_tools.export.animation import Animation, read_animation
from manipnet_tools.export.avatar_bvh import write_avatar_bvh
from manipnet_tools.export.avatar_motion import avatar_motion
from manipnet_tools.export.avatar_tracks import carry_animation, joints_on
from manipnet_tools.export.bvh_out import write_bvh
from manipnet_tools.export.csv_out import write_csv
from manipnet_tools.export.gltf_out import write_gltf
from manipnet_tools.hands.importing import import_rig, profile_name
from manipnet_tools.takes.meshes import named_files
from manipnet_tools.terminal import open_console


def run(options: ExportOptions) -> None:
    """Read the source, write the files and print what they hold.

    Raises `ExportError`, `TakeError`, `RecordingError`, `MeshError`, `ProfileError`, `RigFileError` and `OSError`.
    """
    console = open_console()
    with console.status(f"reading {options.source}"):
        animation = read_animation(options.source, shipped_hand(), options.actor)
        files = named_files(options.mesh, animation.objects)
        given = {name: load_mesh(file, name=name) for name, file in files.items()}
        animation = replace(animation, meshes=animation.meshes | given)
        avatar = None
        if options.hand is not None and options.hand.suffix.lower() in RIG_SUFFIXES:
            rig = import_rig(options.hand, profile_name(options.hand), shipped_hand(), console.print, options.map)
            if options.format == "csv":
                animation = carry_animation(animation, rig.profile)
            else:
                avatar = avatar_motion(rig, joints_on(animation, rig.profile))
        elif options.hand is not None:
            animation = carry_animation(animation, read_profile(options.hand))
    with console.status(f"writing {options.out}"):
        if options.format == "bvh" and avatar is not None:
            write_avatar_bvh(animation, avatar, options.out, options.force)
        elif options.format == "bvh":
            write_bvh(animation, options.out, options.right_handed, options.force)
        elif options.format == "gltf":
            write_gltf(animation, options.out, avatar)
        else:
            write_csv(animation, options.out)
    console.print(f"wrote {options.out}: {summary(animation)}")
    if options.format == "gltf" and (bare := animation.objects.keys() - animation.meshes.keys()):
        console.print(f"not in the file because they have no mesh (--mesh NAME=FILE): {', '.join(sorted(bare))}")


def summary(animation: Animation) -> str:
    """What an animation contains, as a line of text."""
    seconds = len(animation.time_s) / animation.rate_hz
    hands = " and ".join(animation.hands)
    objects = f", objects {', '.join(animation.objects)}" if animation.objects else ""
    held = {side: (~hand.live).sum() for side, hand in animation.hands.items()}
    lost = "".join(f"; {side} held or at rest in {count} frames" for side, count in held.items() if count)
    return f"{len(animation.time_s)} frames at {animation.rate_hz:g} Hz ({seconds:.1f} s), {hands}{objects}{lost}"
