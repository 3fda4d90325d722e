"""`manipnet export`: fingers and objects for other programs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console

from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.mesh import load_mesh
from manipnet_tools.export.animation import Animation, ExportError, read_performance, with_meshes
from manipnet_tools.export.bvh_out import write_bvh
from manipnet_tools.export.csv_out import write_csv
from manipnet_tools.export.gltf_out import write_gltf
from manipnet_tools.takes.meshes import named_files

SUFFIXES = {"gltf": (".glb", ".gltf"), "csv": (".csv",)}


@dataclass(frozen=True)
class ExportOptions:
    """Write hands and objects for other programs.

    bvh: a folder with one file per hand and object, the ManipNet dataset's skeleton. gltf: one file with skinned hands,
    objects and their animation. csv: one table.
    """

    source: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RECORDING|NPZ|TAKE")]
    """A recording with hands, a file of `manipnet synthesize`, or a captured take (folder of BVH files)."""
    format: Literal["bvh", "gltf", "csv"]
    """What to write."""
    out: Annotated[Path, tyro.conf.arg(metavar="PATH")]
    """The file to write (.glb, .gltf or .csv); for bvh a folder."""
    mesh: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="NAME=FILE")] = ()
    """gltf: the mesh of an object, in metres, where the source does not know it."""
    actor: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Whose hands, where a recording has several actors; the first one's by default."""
    right_handed: bool = False
    """bvh: right-handed centimetres, for Blender and Maya, instead of the dataset's left-handed decimetres."""


def run(options: ExportOptions) -> None:
    """Read, write, say what. Raises `ExportError`, `TakeError`, `RecordingError`, `MeshError` and `OSError`."""
    check(options)
    console = Console(stderr=True)
    with console.status(f"reading {options.source}"):
        performance = read_performance(options.source, shipped_hand(), options.actor)
        files = named_files(options.mesh, performance.objects)
        performance = with_meshes(performance, {name: load_mesh(file, name=name) for name, file in files.items()})
    with console.status(f"writing {options.out}"):
        if options.format == "bvh":
            write_bvh(performance, options.out, options.right_handed)
        elif options.format == "gltf":
            write_gltf(performance, options.out)
        else:
            write_csv(performance, options.out)
    console.print(f"wrote {options.out}: {summary(performance)}", soft_wrap=True)
    if options.format == "gltf" and (bare := performance.objects.keys() - performance.meshes.keys()):
        console.print(f"without a mesh, so not to be seen: {', '.join(sorted(bare))} (--mesh NAME=FILE)")


def check(options: ExportOptions) -> None:
    """Raise `ExportError` for options that contradict each other, before any work."""
    suffixes = SUFFIXES.get(options.format)
    if suffixes and options.out.suffix.lower() not in suffixes:
        raise ExportError(f"--out {options.out}: for --format {options.format} it must end in {' or '.join(suffixes)}")
    if options.right_handed and options.format != "bvh":
        raise ExportError(f"--right-handed is for bvh; {options.format} is right-handed anyway")
    if not options.out.absolute().parent.is_dir():
        raise ExportError(f"--out {options.out}: its folder does not exist; make it first")


def summary(performance: Animation) -> str:
    """What a performance holds, in words."""
    seconds = len(performance.time_s) / performance.rate_hz
    hands = " and ".join(performance.hands)
    objects = f", objects {', '.join(performance.objects)}" if performance.objects else ""
    held = {side: (~hand.live).sum() for side, hand in performance.hands.items()}
    lost = "".join(f"; {side} held or at rest in {count} frames" for side, count in held.items() if count)
    return f"{len(performance.time_s)} frames at {performance.rate_hz:g} Hz ({seconds:.1f} s), {hands}{objects}{lost}"
