"""The recipe of a model: its architecture, its samples and its optimiser."""

from dataclasses import dataclass
from typing import Final, Literal

from manipnet.common.options import ConfigError

Architecture = Literal["manipnet", "resnet", "mlp"]
_LEAST: Final = {"width": 3, "rounds": 1, "epochs_per_round": 1, "batch": 1, "roll_out_ticks": 1}


@dataclass(frozen=True)
class TrainConfig:
    """The recipe of a model. The defaults are those of the shipped bundles."""

    width: int = 384
    """Units of each layer; the paper has 1536."""
    architecture: Architecture = "resnet"
    """manipnet: the paper's residual dense blocks; resnet: plain residual blocks; mlp: neither."""
    predict_change: bool = False
    """Predict the change of the pose, in units of its own deviation, instead of the pose."""
    hidden: tuple[str, ...] = ()
    """Inputs that the network does not see: names of blocks, or `future`."""
    dropout: float = 0.3
    """Share of the activations that are dropped in training."""
    rounds: int = 4
    """Number of rounds, each with new samples."""
    epochs_per_round: int = 5
    """Passes over the samples of a round."""
    batch: int = 128
    """Samples per step of the optimiser."""
    learning_rate: float = 7e-4
    """Step size of the optimiser at the start; it falls to a fiftieth along a cosine."""
    weight_decay: float = 1e-2
    """Weight decay of the optimiser."""
    huber: float = 0.5
    """Errors beyond this many standard deviations count linearly instead of squared; 0 squares all errors."""
    weight_average: float = 0.999
    """Decay of the running average of the weights that is shipped; with 0, the last weights are shipped."""
    residual_error: float = 0.0
    """Share of a pose error that may remain after one tick."""
    response: float = 0.5
    """Share of the way to the answer that a hand moves in one tick. The answer leads by the lag that this causes."""
    captured: float = 0.3
    """Samples at captured poses, per captured frame and round."""
    blended: float = 0.6
    """Samples at blended poses, per captured frame and round."""
    on_policy: float = 0.4
    """Samples at poses that the model itself reaches, per captured frame and round."""
    roll_out_ticks: int = 40
    """Length of the roll-outs that on-policy samples come from."""
    round_samples: int = 80_000
    """A round has at most so many samples; from long takes, each round draws others."""
    warp: float = 0.2
    """Time is played faster or slower by a factor up to exp of this."""
    sliding: float = 0.0
    """Share of the samples in which the object also moves in the hand, which generated hands never do by themselves."""
    time_reversed: bool = False
    """Learn every take played backwards as well."""
    seed: int = 0
    """Seed of every random number."""

    def check(self) -> None:
        """Raise `ConfigError` for a number with which nothing can be trained."""
        for name, least in (_LEAST | {"round_samples": self.batch}).items():
            if (value := getattr(self, name)) < least:
                raise ConfigError(f"--training.{name.replace('_', '-')} is {value}; it must be at least {least}")
        if not 0.0 <= self.sliding <= 1.0:
            raise ConfigError(f"--training.sliding is {self.sliding:g}; it must be from 0 to 1")
        if self.captured + self.blended <= 0.0 or min(self.captured, self.blended, self.on_policy) < 0.0:
            raise ConfigError(
                "--training.captured, --training.blended and --training.on-policy must not be negative, and one of the "
                "first two must be above 0"
            )


FOR_GENERATED: Final = TrainConfig(rounds=8, epochs_per_round=4, sliding=0.5)
"""The recipe of `manipnet-open`, for takes of `manipnet generate`."""
