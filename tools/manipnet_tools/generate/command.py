"""`manipnet generate`: makes takes for training, of free hands with objects made by rule and chance."""

import json
import math
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Final

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from manipnet.common.atomic_file import replacing
from manipnet.geometry import SIDES
from manipnet.synthesis.hand.hand_file import write_hand
from manipnet_tools.generate.job import TAKE_S, MadeTake, hand_name, hand_of, make_take, take_name
from manipnet_tools.generate.options import GenerateOptions
from manipnet_tools.generate.proportions import HANDS
from manipnet_tools.generate.sheet import write_grasp_sheet
from manipnet_tools.generate.statistics import print_statistics, statistics
from manipnet_tools.generate.training import require_training, train_on
from manipnet_tools.importing.dataset_writer import write_mesh
from manipnet_tools.takes.dataset import TAKE_FILE
from manipnet_tools.takes.sources import TakeSource, add_sources
from manipnet_tools.takes.take_file import write_take_file
from manipnet_tools.terminal import open_console

SET_FILE: Final = "generate.json"
RECIPE: Final = 4
"""Raised when the same seed gives other takes than before."""
LICENCE: Final = "Apache-2.0"
SHEET_FILE: Final = "grasps.png"


class GenerateError(ValueError):
    """The set cannot be made; the text says why and what to do."""


def run(options: GenerateOptions) -> None:
    """Make every take that is missing, and train on them if asked to.

    Raises `GenerateError`, `ClusterError`, `OSError`, and what training raises.
    """
    if options.train is not None:
        require_training()
    count = max(math.ceil(options.hours * 3600.0 / TAKE_S), 1)
    _begin(options, count)
    missing = [k for k in range(count) if not (options.out / "takes" / take_name(k) / TAKE_FILE).is_file()]
    console = open_console()
    columns = TextColumn("generating"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        bar = progress.add_task("", total=count, completed=count - len(missing))
        for made in _made(options, missing):
            write_mesh(made.mesh, options.out, made.take.object_name)
            write_take_file(made.take, options.out / "takes" / made.name)
            progress.advance(bar)
    found = statistics(options.out)
    with replacing(options.out / "statistics.json") as file:
        file.write(json.dumps(found, indent=1).encode())
    print_statistics(found, console)
    write_grasp_sheet(options.out, options.out / SHEET_FILE)
    console.print(f"look at {options.out / SHEET_FILE}")
    if options.train is not None:
        train_on(options.out, options.train, options.seed)


def _begin(options: GenerateOptions, count: int) -> None:
    """Write what describes the set, or check that the folder holds a part of the same one."""
    path = options.out / SET_FILE
    mine = {"recipe": RECIPE, "seed": options.seed}
    if path.is_file():
        try:
            there = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            raise GenerateError(f"{path}: is damaged; write to another folder") from None
        if there != mine:
            raise GenerateError(
                f"{options.out}: holds a set of {there}, and this is one of {mine}; write to another folder"
            )
    elif options.out.is_dir() and any(options.out.iterdir()):
        raise GenerateError(f"{options.out}: is not empty and holds no generated set; write to another folder")
    (options.out / "hands").mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(mine) + "\n", encoding="utf-8")
    for number in range(HANDS):
        write_hand(hand_of(number, options.seed), options.out / "hands" / f"{hand_name(number)}.npz")
    source = TakeSource("takes of manipnet generate", LICENCE, "", "", f"seed {options.seed}", SIDES, {})
    add_sources(options.out, {take_name(k): source for k in range(count)})


def _made(options: GenerateOptions, numbers: Sequence[int]) -> Iterator[MadeTake]:
    """The takes of these numbers as they are finished."""
    processes = min(options.jobs or os.cpu_count() or 1, max(len(numbers), 1))
    if options.ray is not None:
        from manipnet_tools.batch.cluster import cluster
        from manipnet_tools.generate.on_cluster import made_on_cluster

        with cluster(options.ray, processes) as processors:
            yield from made_on_cluster(numbers, options.seed, processors)
    elif processes == 1:
        yield from (make_take(number, options.seed) for number in numbers)
    else:
        with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
            try:
                for future in as_completed([pool.submit(make_take, number, options.seed) for number in numbers]):
                    yield future.result()
            except BrokenProcessPool:
                remedy = "run the same command again to continue, perhaps with fewer --jobs"
                raise GenerateError(f"a process died, perhaps for lack of memory; {remedy}") from None
            finally:
                pool.shutdown(cancel_futures=True)
