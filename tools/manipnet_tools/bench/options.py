"""Options of `manipnet bench`, apart from its libraries so that `--help` is quick."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal, get_args

from manipnet.common.options import ConfigError
from manipnet.synthesis.model.providers import DEFAULT_MODEL, Provider
from manipnet.synthesis.model.shipped import find_bundle
from manipnet_tools.commands.arguments import UseAppendAction, arg
from manipnet_tools.commands.checks import require_meshes, require_new, require_take
from manipnet_tools.commands.options import WritingOptions

Section = Literal[
    "tick", "models", "triangles", "actors", "intake", "straightforward", "start", "live", "cost", "minutes"
]
SECTIONS: Final[tuple[Section, ...]] = get_args(Section)
USUAL: Final[tuple[Section, ...]] = tuple(name for name in SECTIONS if name != "minutes")
"""The sections of `--full`."""
QUICK_S: Final = 12.0
FULL_S: Final = 100.0


@dataclass(frozen=True)
class BenchOptions(WritingOptions):
    """Measure whether this computer is fast enough.

    With --full or --only: how long each stage of a tick takes, beside a reference that is measured in the same run,
    which needs the extra train.
    """

    full: bool = False
    """Measure all sections but `minutes`, which takes ten minutes."""
    take: Annotated[Path | None, arg(metavar="TAKE", help_behavior_hint="")] = None
    """Measure on this take instead of the bundled demo."""
    mesh: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME=FILE")] = ()
    """The mesh of the take's object NAME."""
    model: Annotated[str, arg(metavar="NAME")] = DEFAULT_MODEL
    """The model: the name of a shipped bundle, or a bundle's folder."""
    beside: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME")] = ()
    """Also time the ticks of this model."""
    provider: Provider = "cpu"
    """What the models run on."""
    json: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None
    """Also write all figures to this file."""
    seconds: Annotated[float | None, arg(metavar="SECONDS", help_behavior_hint="")] = None
    """Total time of the timed parts, 12 s or with --full 100 s. Building models and starting servers takes more."""
    only: UseAppendAction[tuple[Section, ...]] = ()
    """Measure only this section; repeatable."""

    @property
    def is_quick(self) -> bool:
        """Whether only the verdict is wanted."""
        return not (self.full or self.only or self.beside)

    def check(self) -> None:
        """Raise `ConfigError` or `BundleError` for values that cannot be used."""
        if self.take is not None:
            require_take(self.take)
        elif self.mesh:
            raise ConfigError(f"--mesh {self.mesh[0]}: is for a take; the demo has its own meshes, so give --take TAKE")
        require_meshes(self.mesh)
        for model in (self.model, *self.beside):
            find_bundle(model)
        require_new(self.json, self.force, "--json")
        if self.seconds is not None and self.seconds <= 0.0:
            raise ConfigError(f"--seconds is {self.seconds:g}; it must be more than 0")
