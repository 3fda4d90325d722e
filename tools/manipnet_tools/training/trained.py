"""A trained model, and how it becomes a bundle."""

from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path

import numpy as np

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.model.bundle import write_bundle
from manipnet_tools.takes.sources import MANIPNET_LICENCE
from manipnet_tools.training.config import TrainConfig
from manipnet_tools.training.model import ManipNet, export_onnx
from manipnet_tools.training.quantise import halve_weights


@dataclass(frozen=True, eq=False)
class Trained:
    """A trained model with everything else that a bundle needs."""

    model: ManipNet
    hand: Hand
    rest_angles: Array
    """`(A,)` radians."""
    limits: Array
    """`(A, 2)` radians."""
    config: TrainConfig
    takes: tuple[str, ...]
    """Names of the takes that were used."""
    share: float
    """Share of each take that was used, from its start."""
    seconds: float
    """Time that training took."""
    licence: str = MANIPNET_LICENCE
    """The terms of the takes, which are those of the model."""
    started_from: str | None = None
    """SHA-256 of the bundle whose weights training went on from."""


def save_bundle(trained: Trained, folder: Path) -> None:
    """Write `manipnet.onnx`, `hand.npz` and `bundle.json`."""
    training = {
        **asdict(trained.config),
        "takes": list(trained.takes),
        "share": trained.share,
        "started_from": trained.started_from,
        "minutes": round(trained.seconds / 60, 1),
        "date": date.today().isoformat(),
    }
    meta = {
        "rest_angles_rad": [round(float(a), 6) for a in trained.rest_angles],
        "response": trained.config.response,
        "limits_rad": np.round(trained.limits, 6).tolist(),
        "training": training,
        "licence": trained.licence,
    }
    write_bundle(folder, halve_weights(export_onnx(trained.model)), trained.hand, meta)
