"""Options of `manipnet train` and `manipnet quantise`, apart from their libraries so that `--help` is quick."""

from dataclasses import dataclass, field
from pathlib import Path

from tyro.conf import Positional

from manipnet_tools.training.config import TrainConfig


@dataclass(frozen=True)
class TrainOptions:
    """Train a model on the published takes."""

    data: Path
    """The dataset's folder, with BVH/ and meshes/."""
    out: Path
    """Folder of the bundle to write."""
    leave_out: tuple[str, ...] = ()
    """Takes that are not used."""
    share: float = 1.0
    """Train on this share of each take, from its start; 0.8 leaves what `manipnet evaluate` tests as seen."""
    training: TrainConfig = field(default_factory=TrainConfig)


@dataclass(frozen=True)
class QuantiseOptions:
    """Write a copy of a bundle with 8-bit weights, or 4-bit ones in wide layers: smaller, and faster if it is wide."""

    model: Positional[str]
    """The bundle: the name of a shipped one, or its folder."""
    out: Path
    """Folder of the bundle to write."""
