"""Where bundles are, and the hand of the shipped ones for code that needs one without a model.

Finding a bundle imports neither NumPy nor ONNX Runtime, so that a command can name a wrong one at once.
"""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Final

from manipnet.synthesis.model.providers import DEFAULT_MODEL

if TYPE_CHECKING:
    from manipnet.synthesis.hand.hand import Hand


NO_LICENCE: Final = "not stated"


class BundleError(ValueError):
    """A bundle that cannot be used; the text names the file, what is wrong and what is expected."""


def models_folder() -> Path:
    """The folder of the shipped bundles: inside an installed package, or at the top of a checkout."""
    package = Path(__file__).resolve().parents[2]
    installed = package / "models"
    return installed if installed.is_dir() else package.parents[1] / "models"


def shipped_models() -> list[str]:
    """Names of the shipped bundles."""
    return sorted(path.name for path in models_folder().glob("*") if (path / "bundle.json").is_file())


def licence_of(folder: Path) -> str:
    """The licence that a bundle states. Raises `BundleError` if its description cannot be read."""
    file = folder / "bundle.json"
    try:
        return str(json.loads(file.read_text(encoding="utf-8")).get("licence") or NO_LICENCE)
    except (OSError, ValueError, AttributeError) as error:
        raise BundleError(f"{file}: cannot be read ({error})") from None


def version_text(program: str, version: str) -> str:
    """What `--version` prints: the version, and the licence of the code and of each shipped model."""
    licences: dict[str, list[str]] = {}
    for name in shipped_models():
        licences.setdefault(licence_of(models_folder() / name), []).append(name)
    models = [f"models {', '.join(names)}: {licence}" for licence, names in licences.items()]
    return "\n".join([f"{program} {version}", "code: Apache-2.0", *models])


def find_bundle(model: Path | str) -> Path:
    """The folder of a bundle, which is given by its folder or by the name of a shipped one. Raises `BundleError`."""
    folder = Path(model) if Path(model).is_dir() else models_folder() / str(model)
    if not folder.is_dir():
        shipped = ", ".join(shipped_models())
        raise BundleError(f"model {str(model)!r} is neither a folder nor a shipped bundle; shipped are {shipped}")
    return folder


def shipped_hand(model: str = DEFAULT_MODEL) -> "Hand":
    """The hand of a shipped bundle. Raises `HandError`."""
    from manipnet.synthesis.hand.hand_file import HAND_FILE, read_hand

    return read_hand(models_folder() / model / HAND_FILE)
