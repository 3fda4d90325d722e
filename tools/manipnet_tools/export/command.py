"""`manipnet export`: writes hands and objects for other programs."""

from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.mesh import load_mesh
from manipnet_tools.commands.options import ExportOptions
from manipnet_tools.export.animation import Animation, ExportError, read_animation, with_meshes
from manipnet_tools.export.bvh_out import write_bvh
from manipnet_tools.export.csv_out import write_csv
from manipnet_tools.export.gltf_out import write_gltf
from manipnet_tools.takes.meshes import named_files
from manipnet_tools.terminal import open_console

SUFFIXES = {"gltf": (".glb", ".gltf"), "csv": (".csv",)}


def run(options: ExportOptions) -> None:
    """Read the source, write the files and print what they hold.

    Raises `ExportError`, `TakeError`, `RecordingError`, `MeshError` and `OSError`.
    """
    check(options)
    console = open_console()
    with console.status(f"reading {options.source}"):
        animation = read_animation(options.source, shipped_hand(), options.actor)
        files = named_files(options.mesh, animation.objects)
        animation = with_meshes(animation, {name: load_mesh(file, name=name) for name, file in files.items()})
    with console.status(f"writing {options.out}"):
        if options.format == "bvh":
            write_bvh(animation, options.out, options.right_handed)
        elif options.format == "gltf":
            write_gltf(animation, options.out)
        else:
            write_csv(animation, options.out)
    console.print(f"wrote {options.out}: {summary(animation)}")
    if options.format == "gltf" and (bare := animation.objects.keys() - animation.meshes.keys()):
        console.print(f"not in the file because they have no mesh (--mesh NAME=FILE): {', '.join(sorted(bare))}")


def check(options: ExportOptions) -> None:
    """Raise `ExportError` for options that contradict each other, before any work."""
    suffixes = SUFFIXES.get(options.format)
    if suffixes and options.out.suffix.lower() not in suffixes:
        raise ExportError(f"--out {options.out}: for --format {options.format} it must end in {' or '.join(suffixes)}")
    if options.right_handed and options.format != "bvh":
        raise ExportError(f"--right-handed is for --format bvh only; {options.format} is always right-handed")
    if not options.out.absolute().parent.is_dir():
        raise ExportError(f"--out {options.out}: its folder does not exist; create it first")


def summary(animation: Animation) -> str:
    """What an animation holds, in words."""
    seconds = len(animation.time_s) / animation.rate_hz
    hands = " and ".join(animation.hands)
    objects = f", objects {', '.join(animation.objects)}" if animation.objects else ""
    held = {side: (~hand.live).sum() for side, hand in animation.hands.items()}
    lost = "".join(f"; {side} held or at rest in {count} frames" for side, count in held.items() if count)
    return f"{len(animation.time_s)} frames at {animation.rate_hz:g} Hz ({seconds:.1f} s), {hands}{objects}{lost}"
