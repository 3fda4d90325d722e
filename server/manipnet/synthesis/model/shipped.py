"""The bundles that come with this version: where they are, and their hand for whoever needs one without a model."""

from pathlib import Path

from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.hand_file import HAND_FILE, read_hand
from manipnet.synthesis.model.providers import DEFAULT_MODEL


def models_folder() -> Path:
    """The folder of the shipped bundles: inside an installed package, or at the top of a checkout."""
    package = Path(__file__).resolve().parents[2]
    installed = package / "models"
    return installed if installed.is_dir() else package.parents[1] / "models"


def shipped_models() -> list[str]:
    """Names of the shipped bundles."""
    return sorted(path.name for path in models_folder().glob("*") if (path / "bundle.json").is_file())


def shipped_hand(model: str = DEFAULT_MODEL) -> Hand:
    """The hand of a shipped bundle. Raises `HandError`."""
    return read_hand(models_folder() / model / HAND_FILE)
