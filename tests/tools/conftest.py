"""Real takes, and a model without training for tests that are not about the model."""

from pathlib import Path

import numpy as np
import pytest
from tiny_bundle import write_still_bundle

from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.evaluation.cases import Case, load_cases

TAKES = ("cyl_med3", "mug1")
STILL_ANGLES = np.clip(np.full(20, 0.2), *shipped_hand().limits.T)


@pytest.fixture(scope="session")
def cases(manipnet_data) -> dict[str, Case]:
    """Two real takes by name."""
    return {case.name: case for case in load_cases(manipnet_data, TAKES)}


@pytest.fixture(scope="session")
def still_model(tmp_path_factory) -> Path:
    """A bundle whose network always answers with `STILL_ANGLES`, far from any surface."""
    return write_still_bundle(tmp_path_factory.mktemp("still"), STILL_ANGLES)
