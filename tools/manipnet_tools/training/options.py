"""Options of `manipnet train` and `manipnet quantise`, apart from their libraries so that `--help` is quick."""

from dataclasses import dataclass, field
from pathlib import Path

from manipnet.synthesis.model.shipped import find_bundle
from manipnet_tools.commands.arguments import Positional
from manipnet_tools.commands.checks import require_new_bundle
from manipnet_tools.commands.options import WritingOptions
from manipnet_tools.takes.dataset import DataError, take_folders
from manipnet_tools.training.config import TrainConfig


@dataclass(frozen=True)
class TrainOptions(WritingOptions):
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

    def check(self) -> None:
        """Raise `DataError` unless there are takes to train on, and `ConfigError` for a bundle that exists already."""
        require_new_bundle(self.out, self.force)
        self.takes()

    def takes(self) -> list[str]:
        """Names of the takes to train on. Raises `DataError` if there are none."""
        names = [folder.name for folder in take_folders(self.data)]
        if unknown := set(self.leave_out) - set(names):
            raise DataError(f"--leave-out {min(unknown)}: the takes of {self.data} are {', '.join(names)}")
        if not (left := [name for name in names if name not in self.leave_out]):
            raise DataError(f"--leave-out names every take of {self.data}; leave some to train on")
        return left


@dataclass(frozen=True)
class QuantiseOptions(WritingOptions):
    """Write a copy of a bundle with 8-bit weights, or 4-bit ones in wide layers: smaller, and faster if it is wide."""

    model: Positional[str]
    """The bundle: the name of a shipped one, or its folder."""
    out: Path
    """Folder of the bundle to write."""

    def check(self) -> None:
        """Raise `BundleError` for a bundle that does not exist, and `ConfigError` for one that would be replaced."""
        require_new_bundle(self.out, self.force)
        find_bundle(self.model)
