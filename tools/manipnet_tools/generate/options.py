"""Options of `manipnet generate`, apart from its libraries so that `--help` is quick."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

from manipnet.common.options import ConfigError
from manipnet_tools.commands.arguments import arg
from manipnet_tools.commands.checks import require_new_bundle

MOST_HOURS: Final = 800.0
"""So many takes have names of five digits."""


@dataclass(frozen=True)
class GenerateOptions:
    """Make takes for training out of nothing: objects, grasps that hold in a simulator, and motions of two hands.

    They are free of anybody's terms. A folder that is not complete is continued where it was left.
    """

    out: Annotated[Path, arg(metavar="FOLDER")]
    """The folder to write, which `manipnet train --data` reads."""
    hours: Annotated[float, arg(metavar="H")] = 1.0
    """How much motion to make; two hands move in every second of it."""
    seed: Annotated[int, arg(metavar="N")] = 0
    """Another seed gives other objects, grasps and motions."""
    jobs: Annotated[int | None, arg(metavar="N", help_behavior_hint="")] = None
    """Number of takes at the same time on this machine; by default one per processor."""
    ray: Annotated[str | None, arg(metavar="ADDRESS", help_behavior_hint="")] = None
    """Work on a Ray cluster instead: HOST:PORT, auto for the one on this machine, or local to start one here."""

    train: Annotated[Path | None, arg(metavar="BUNDLE", help_behavior_hint="")] = None
    """Then train a model on these takes, by the recipe of manipnet-open, and write it to this folder."""

    def check(self) -> None:
        """Raise `ConfigError` for a number out of range or a bundle that exists already."""
        if self.train is not None:
            require_new_bundle(self.train, force=False, option="--train")
        if not 0.0 < self.hours <= MOST_HOURS:
            raise ConfigError(f"--hours is {self.hours:g}; it must be above 0 and at most {MOST_HOURS:g}")
        if self.seed < 0:
            raise ConfigError(f"--seed is {self.seed}; it must not be negative")
        if self.jobs is not None and self.jobs < 1:
            raise ConfigError(f"--jobs is {self.jobs}; it must be at least 1")
