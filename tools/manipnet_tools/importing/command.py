"""`manipnet import`: makes takes for training out of captured hands of other people."""

import re
from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track

from manipnet.geometry import Side
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.mesh import ClosedMesh, MeshError, load_mesh
from manipnet_tools.export.animation import ExportError
from manipnet_tools.export.bvh_out import file_stem
from manipnet_tools.importing.bvh_takes import bvh_take_folders, read_bvh_take
from manipnet_tools.importing.csv_takes import csv_take_files, read_csv_take
from manipnet_tools.importing.dataset_writer import SHORTEST_S, pieces, write_mesh, write_piece
from manipnet_tools.importing.dexterhand import open_dexterhand
from manipnet_tools.importing.options import ImportOptions
from manipnet_tools.importing.retarget import Fit, fit_hand
from manipnet_tools.importing.source import ImportingError, Origin, SourceSet
from manipnet_tools.importing.taco import open_taco
from manipnet_tools.takes.meshes import named_files
from manipnet_tools.takes.sources import TakeSource, add_sources
from manipnet_tools.terminal import open_console


def run(options: ImportOptions) -> None:
    """Import every take that can be, and report the others.

    Raises `ImportingError` if there is none, and `MeshError`, `DataError` and `OSError`.
    """
    options.check()
    hand, console = shipped_hand(), open_console()
    source = open_set(options, hand)
    names = [name for name in source.takes if fnmatchcase(name, options.only)]
    if not names:
        raise ImportingError(
            f"--only {options.only}: matches none of {len(source.takes)} takes, such as {source.takes[0]}"
        )
    (options.out / "BVH").mkdir(parents=True, exist_ok=True)
    written: dict[str, TakeSource] = {}
    for name in track(names, "importing", console=console, disable=not console.is_terminal):
        try:
            made = import_take(source, name, hand, options.out)
        except (ImportingError, MeshError, ExportError) as error:
            console.print(f"{name} is left out: {error}", style="red", markup=False)
            continue
        add_sources(options.out, made)
        written |= made
        _report(name, made, console)
    if not written:
        raise ImportingError(f"no take of {options.path} could be imported, for the reasons above")
    console.print(f"wrote {len(written)} takes to {options.out}: manipnet train --data {options.out}")


def open_set(options: ImportOptions, hand: Hand) -> SourceSet:
    """The takes at the path. Raises `ImportingError`, `MeshError` and `TakeError`."""
    if options.kind == "taco":
        return open_taco(options.path)
    if options.kind == "dexterhand":
        return open_dexterhand(options.path, hand)
    meshes = {name: load_mesh(file, name=name) for name, file in named_files(options.mesh).items()}
    origin = Origin(options.name or options.path.absolute().with_suffix("").name, options.licence, "")

    def mesh(name: str) -> ClosedMesh:
        if name not in meshes:
            raise ImportingError(f"the object {name!r} has no mesh; give --mesh {name}=FILE")
        return meshes[name]

    files: Mapping[str, Path]
    if options.kind == "bvh":
        files, read = bvh_take_folders(options.path), read_bvh_take
    else:
        files, read = csv_take_files(options.path), read_csv_take
    return SourceSet(origin, tuple(files), lambda name: read(name, files[name], hand), mesh)


def import_take(source: SourceSet, name: str, hand: Hand, data: Path) -> dict[str, TakeSource]:
    """Read, fit and write one take; returns what was written, by the names of the new takes.

    Raises `ImportingError`, `MeshError` and `ExportError`.
    """
    take = source.read(name)
    if not take.objects:
        raise ImportingError("has no object; a take for training needs the poses of what the hands hold")
    meshes = {stem: source.mesh(stem) for stem in take.objects}
    fits: dict[Side, Fit] = {side: fit_hand(joints, side, hand) for side, joints in take.hands.items()}
    parts = list(pieces(take, fits, _take_name(source.origin.name, take.name)))
    if not parts:
        raise ImportingError(f"has no {SHORTEST_S} s in which its hands and objects are all there")
    for stem, mesh in meshes.items():
        write_mesh(mesh, data, file_stem(stem))
    made = {}
    for part in parts:
        write_piece(part, hand, data)
        error_mm = {side: round(1e3 * float(np.median(fit.error_m)), 1) for side, fit in part.fits.items()}
        origin = source.origin
        made[part.name] = TakeSource(
            origin.name, origin.licence, origin.attribution, origin.url, name, tuple(part.fits), error_mm
        )
    return made


def _take_name(origin: str, name: str) -> str:
    """A name for a take that is a folder's name on every system."""
    return re.sub(r"[^\w.-]+", "_", name if name == origin else f"{origin} {name}").strip("_").lower()


def _report(name: str, made: dict[str, TakeSource], console: Console) -> None:
    errors = next(iter(made.values())).error_mm
    found = ", ".join(f"{side} hand {mm:.1f} mm" for side, mm in errors.items())
    parts = f" in {len(made)} pieces" if len(made) > 1 else ""
    console.print(f"{name}{parts}: median distance of the joints {found}", markup=False)
