"""Options of `manipnet import`, apart from its libraries so that `--help` is quick."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from manipnet_tools.commands.arguments import Positional, UseAppendAction, arg
from manipnet_tools.commands.checks import require_meshes


@dataclass(frozen=True)
class ImportOptions:
    """Fit the model's hand to captured hands and write takes that `manipnet train` reads.

    taco: the TACO set (CC BY 4.0). dexterhand: the DexterHand set (Apache-2.0). bvh: folders of BVH files with hands
    and objects, as gloves and animation programs write them. csv: tables of joints.
    """

    kind: Annotated[Positional[Literal["taco", "dexterhand", "bvh", "csv"]], arg(metavar="taco|dexterhand|bvh|csv")]
    """What the takes are."""
    path: Annotated[Positional[Path], arg(metavar="PATH")]
    """The folder with the set or the takes; for csv also a single file."""
    out: Annotated[Path, arg(metavar="DATA")]
    """The folder to write, which `manipnet train --data` reads; it may hold other takes."""
    only: Annotated[str, arg(metavar="PATTERN")] = "*"
    """Import only takes whose names match this, for example "(stir, spoon, bowl)/*"."""
    mesh: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME=FILE")] = ()
    """bvh and csv: an object and its mesh in metres."""
    licence: Annotated[str, arg(metavar="TEXT")] = "your own data"
    """bvh and csv: the terms of the takes, which the models that are trained on them state."""
    name: Annotated[str | None, arg(metavar="TEXT", help_behavior_hint="")] = None
    """bvh and csv: what the set is called; by default as the folder or file."""

    def check(self) -> None:
        """Raise `OSError` or `ConfigError` for a path that does not exist."""
        if not self.path.exists():
            raise FileNotFoundError(f"{self.path}: no such file or folder")
        require_meshes(self.mesh)
