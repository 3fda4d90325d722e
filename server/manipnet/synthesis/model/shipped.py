"""Where bundles are, and the hand of the shipped ones for code that needs one without a model.

Finding a bundle imports neither NumPy nor ONNX Runtime, so that a command can name a wrong one at once.
"""

import json
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

from manipnet.synthesis.model.providers import DEFAULT_MODEL

if TYPE_CHECKING:
    from manipnet.synthesis.hand.hand import Hand


NO_LICENCE: Final = "not stated"
FULL_WIDTH_DISTRIBUTION: Final = "manipnet-live-full-width"
FULL_WIDTH_PACKAGE: Final = "manipnet_full_width"
FULL_WIDTH_BUNDLES: Final = ("manipnet-full", "manipnet-full-int8")
"""They are 30 MB, so a package of their own has them, which `models/pyproject.toml` describes."""


class BundleError(ValueError):
    """A bundle that cannot be used; the text names the file, what is wrong and what is expected."""


def models_folder() -> Path:
    """The folder of the bundles that come with the program: inside the package, or at the top of a checkout."""
    package = Path(__file__).resolve().parents[2]
    installed = package / "models"
    return installed if installed.is_dir() else package.parents[1] / "models"


def shipped_bundles() -> dict[str, Path]:
    """The folders of the installed bundles by name, in the order of the names."""
    found = {path.name: path for folder in _folders() for path in folder.glob("*") if (path / "bundle.json").is_file()}
    return dict(sorted(found.items()))


def _folders() -> Iterator[Path]:
    """The folder of the small bundles, and that of the full-width ones if their package is installed."""
    yield models_folder()
    package = find_spec(FULL_WIDTH_PACKAGE)
    yield from map(Path, package.submodule_search_locations or () if package else ())


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
    for name, folder in shipped_bundles().items():
        licences.setdefault(licence_of(folder), []).append(name)
    models = [f"models {', '.join(names)}: {licence}" for licence, names in licences.items()]
    return "\n".join([f"{program} {version}", "code: Apache-2.0", *models])


def find_bundle(model: Path | str) -> Path:
    """The folder of a bundle, which is given by its folder or by the name of a shipped one. Raises `BundleError`."""
    shipped = shipped_bundles()
    folder = Path(model) if Path(model).is_dir() else shipped.get(str(model))
    if folder is None and str(model) in FULL_WIDTH_BUNDLES:
        raise BundleError(
            f"model {str(model)!r} is in the package {FULL_WIDTH_DISTRIBUTION}, which is not installed; in a"
            " checkout, `pip install ./models` builds and installs it"
        )
    if folder is None:
        raise BundleError(
            f"model {str(model)!r} is neither a folder nor a shipped bundle; installed are {', '.join(shipped)}"
        )
    return folder


def shipped_hand(model: str = DEFAULT_MODEL) -> "Hand":
    """The hand of a shipped bundle. Raises `HandError`."""
    from manipnet.synthesis.hand.hand_file import HAND_FILE, read_hand

    return read_hand(find_bundle(model) / HAND_FILE)
