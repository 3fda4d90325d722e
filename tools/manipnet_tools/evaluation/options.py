"""Options of `manipnet evaluate` and `manipnet ablate`, apart from their libraries so that `--help` is quick."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from manipnet.synthesis.ik.solvers import DEFAULT_SOLVER, solver_named
from manipnet.synthesis.model.providers import DEFAULT_MODEL
from manipnet.synthesis.model.shipped import find_bundle
from manipnet_tools.commands.checks import require_new
from manipnet_tools.commands.options import WritingOptions
from manipnet_tools.takes.dataset import take_folders
from manipnet_tools.training.config import TrainConfig

EvaluationProtocol = Literal["seen", "unseen"]
"""seen: the last fifth of every take. unseen: each take with a model that has not seen its object."""
PROTOCOLS: Final[tuple[EvaluationProtocol, ...]] = ("seen", "unseen")
Sweep = Literal["noise", "tracker", "look-ahead", "resolution", "scale", "loop"]

MeasureGroup = Literal["scores", "drop", "realism"]
"""scores: joint error, contacts, penetration, motion and physics. drop: the drop test. realism: whether a classifier
can tell the motion from captured motion."""
MEASURE_GROUPS: Final[tuple[MeasureGroup, ...]] = ("scores", "drop", "realism")

ABLATION_TRAINING: Final = TrainConfig(
    architecture="manipnet", rounds=1, epochs_per_round=6, on_policy=0.0, huber=0.0, weight_average=0.99, response=0.4
)
"""The paper's network, trained for a shorter time than a shipped bundle, because there are 49 models."""


@dataclass(frozen=True)
class EvaluateOptions(WritingOptions):
    """Evaluate models on the dataset's takes: print tables and, on request, write JSON and plots."""

    data: Path
    """The dataset's folder, with BVH/ and meshes/."""
    model: tuple[str, ...] = (DEFAULT_MODEL,)
    """For --protocol seen: bundles trained on the first 80 % of every take, by shipped name or folder."""
    models_dir: tuple[Path, ...] = (Path("unseen"),)
    """For --protocol unseen: folders of bundles, each bundle named by the take left out of its training. Those that
    are missing are trained, which takes long, and kept there."""
    protocol: EvaluationProtocol = "seen"
    """seen: the last 20 % of every take. unseen: every take with a model that has not seen its object."""
    solver: tuple[str, ...] = (DEFAULT_SOLVER, "least_squares", "none")
    """Solvers to test each model with."""
    takes: tuple[str, ...] = ()
    """Test only these takes; all by default."""
    only: tuple[MeasureGroup, ...] = MEASURE_GROUPS
    """Measure only these; drop needs the extra `judge`."""
    fingers: tuple[str, ...] = ()
    """Judge files of `manipnet synthesize` (TAKE=FILE.npz) instead of models. Only the takes named here are tested."""
    sweep: Sweep | None = None
    """Evaluate instead how the hands of the first model change with noise, other tracking systems, a shorter
    look-ahead, other meshes, objects of other sizes, or over ten minutes."""
    json: Path | None = None
    """Write every figure to this file."""
    sheet: Path | None = None
    """Draw captured and synthesised grasps in random order into this PNG, and write which is which into a text file
    beside it. The first model is drawn."""
    plots: Path | None = None
    """Write plots and pictures of the worst frames into this folder."""

    def check(self) -> None:
        """Raise `DataError`, `BundleError`, `UnknownSolverError` or `ConfigError` for values that cannot be used."""
        take_folders(self.data, self.takes)
        for solver in self.solver:
            solver_named(solver)
        if self.protocol == "seen":
            for model in self.model:
                find_bundle(model)
        require_new(self.json, self.force, "--json")
        require_new(self.sheet, self.force, "--sheet")


@dataclass(frozen=True)
class AblateOptions:
    """Train and evaluate the paper's ablation: print tables, and write figures into a folder."""

    data: Path
    """The dataset's folder, with BVH/ and meshes/."""
    out: Path
    """Folder for the bundles, of which those that exist are used again, and for `seen.json` and `unseen.json`."""
    protocol: tuple[EvaluationProtocol, ...] = PROTOCOLS
    """Protocols to test on."""
    training: TrainConfig = ABLATION_TRAINING

    def check(self) -> None:
        """Raise `DataError` for a folder without takes."""
        take_folders(self.data)
