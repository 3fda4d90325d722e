"""Options of `manipnet train` and `manipnet quantise`, apart from their libraries so that `--help` is quick."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from manipnet.common.options import ConfigError
from manipnet.synthesis.model.shipped import find_bundle, licence_of
from manipnet_tools.commands.arguments import Positional, arg
from manipnet_tools.commands.checks import require_new_bundle
from manipnet_tools.commands.options import WritingOptions
from manipnet_tools.training.config import TrainConfig

if TYPE_CHECKING:
    from manipnet_tools.training.mixture import DataFolder


@dataclass(frozen=True)
class TrainOptions(WritingOptions):
    """Train a model on captured takes, on generated ones, or on a mixture of both."""

    data: Annotated[tuple[str, ...], arg(metavar="FOLDER[=WEIGHT]")]
    """Folders of takes: datasets with BVH/ and meshes/, or what `manipnet generate` writes. Each gives samples in
    proportion to its WEIGHT, which is 1 unless given, however long its takes are. The model poses the hand that most
    takes of the first folder have."""
    out: Path
    """Folder of the bundle to write. It is written after each round."""
    start: Annotated[str | None, arg(metavar="BUNDLE", help_behavior_hint="")] = None
    """Go on from the weights of this bundle, by shipped name or folder, with its architecture and normalisation."""
    free: bool = False
    """Refuse takes and bundles whose terms forbid commercial use or do not say that they allow it."""
    leave_out: tuple[str, ...] = ()
    """Takes that are not used."""
    share: float = 1.0
    """Train on this share of each take, from its start; 0.8 leaves what `manipnet evaluate` tests as seen."""
    training: TrainConfig = field(default_factory=TrainConfig)

    def check(self) -> None:
        """Raise `DataError` for takes that cannot be used, `BundleError` for an unknown `--start`, and `ConfigError`
        for a number out of range or a bundle that exists already."""
        require_new_bundle(self.out, self.force)
        if not 0.0 < self.share <= 1.0:
            raise ConfigError(f"--share is {self.share:g}; it must be above 0 and at most 1")
        self.training.check()
        licence = self.licence()
        if self.free:
            from manipnet_tools.training.mixture import require_free

            require_free(licence)

    def folders(self) -> "tuple[DataFolder, ...]":
        """The folders of takes to train on. Raises `DataError`."""
        from manipnet_tools.training.mixture import data_folders

        return data_folders(self.data, self.leave_out)

    def licence(self) -> str:
        """The terms of the model. Raises `DataError` and `BundleError`."""
        from manipnet_tools.training.mixture import licence_of_mixture

        start = None if self.start is None else licence_of(find_bundle(self.start))
        return licence_of_mixture(self.folders(), start)


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
