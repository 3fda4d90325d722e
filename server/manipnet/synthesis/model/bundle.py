"""A model bundle: `manipnet.onnx` with its normalisation inside, `bundle.json` that says what it expects, `CARD.md`."""

import hashlib
import json
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime

from manipnet.geometry import Array
from manipnet.synthesis.hand.skeleton import DOF_COUNT, DOF_NAMES
from manipnet.synthesis.model.layout import INPUT_SIZE, OUTPUT_SIZE, describe
from manipnet.synthesis.model.providers import DEFAULT_MODEL, Provider

FORMAT = 1

_CPU, _CUDA = "CPUExecutionProvider", "CUDAExecutionProvider"
_log = logging.getLogger(__name__)


class BundleError(ValueError):
    """A bundle that cannot be used; the text names the file, what is wrong and what is expected."""


@dataclass(frozen=True, eq=False)
class Bundle:
    """A trained model, ready to run."""

    name: str
    rest_angles: Array
    """`(20,)` neutral pose, radians."""
    limits: Array
    """`(20, 2)` limits of the angles, radians."""
    response: float
    """Share of the way to the network's pose that a hand goes in one tick, in (0, 1]; its poses lead by that lag."""
    meta: dict[str, Any]
    model_hash: str
    session: onnxruntime.InferenceSession
    folder: Path

    @property
    def provider(self) -> Provider:
        """What it runs on: `cpu` or `cuda`."""
        return "cuda" if self.session.get_providers()[0] == _CUDA else "cpu"

    def infer(self, rows: np.ndarray) -> np.ndarray:
        """Network outputs `(N, 220)` of feature rows `(N, 2356)` float32, both in SI units."""
        return np.asarray(self.session.run(None, {"features": rows})[0])


def models_folder() -> Path:
    """Where the shipped bundles are: inside an installed package, or at the top of a checkout."""
    package = Path(__file__).resolve().parents[2]
    installed = package / "models"
    return installed if installed.is_dir() else package.parents[1] / "models"


def load_bundle(model: Path | str = DEFAULT_MODEL, provider: Provider = "cpu") -> Bundle:
    """Load a bundle by folder or by the name of a shipped one. Raises `BundleError`.

    Where a GPU was asked for or is expected and cannot be had, a line of the log says why, and it runs on the
    processor.
    """
    folder = Path(model)
    if not folder.is_dir():
        folder = models_folder() / str(model)
    if not folder.is_dir():
        shipped = sorted(path.name for path in models_folder().glob("*") if (path / "bundle.json").is_file())
        raise BundleError(f"model {str(model)!r} is no folder and no shipped bundle; shipped are {', '.join(shipped)}")
    meta = _read_meta(folder / "bundle.json")
    path = folder / "manipnet.onnx"
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BundleError(f"{path}: cannot be read ({error.strerror})") from None
    model_hash = hashlib.sha256(content).hexdigest()
    if meta.get("model_sha256") != model_hash:
        raise BundleError(f"{path}: its hash is not the one in bundle.json; the bundle is damaged, copy it again")
    session = open_session(path, content, provider)
    return Bundle(folder.name, *_read_pose(folder, meta), meta, model_hash, session, folder)


def open_session(path: Path | str, content: bytes, provider: Provider = "cpu") -> onnxruntime.InferenceSession:
    """A graph on one thread; raises `BundleError`, naming `path`, for one that is not of the feature layout."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    providers = _providers(provider)
    try:
        session = onnxruntime.InferenceSession(content, options, providers=providers)
    except Exception as error:  # the runtime raises its own zoo of exceptions for a bad graph
        raise BundleError(f"{path}: not a model this runtime can open ({error})") from None
    if session.get_providers()[0] != providers[0]:
        _log.warning("CUDA could not be started (driver or CUDA libraries missing); the network runs on the processor")
    sizes = [node.shape[-1] for node in (*session.get_inputs(), *session.get_outputs())]
    if sizes != [INPUT_SIZE, OUTPUT_SIZE]:
        raise BundleError(f"{path}: takes and gives {sizes} numbers; expected are {[INPUT_SIZE, OUTPUT_SIZE]}")
    return session


def _providers(asked: Provider) -> list[str]:
    """ONNX Runtime's names, the preferred one first."""
    if asked != "cpu" and _CUDA in onnxruntime.get_available_providers():
        return [_CUDA, _CPU]
    if asked == "cuda":
        _log.warning(
            "the provider cuda is not installed (python -m pip install 'manipnet-live[gpu]'); the network runs on the "
            "processor"
        )
    return [_CPU]


def _read_meta(path: Path) -> dict[str, Any]:
    try:
        meta = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BundleError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError) as error:
        raise BundleError(f"{path}: not JSON ({error})") from None
    if not isinstance(meta, dict) or meta.get("format") != FORMAT:
        found = meta.get("format") if isinstance(meta, dict) else None
        raise BundleError(f"{path}: bundle format {found!r}, this version reads {FORMAT}; train or download it again")
    if meta.get("layout") != describe():
        raise BundleError(f"{path}: trained for another feature layout than this version's; train it again")
    if meta.get("dofs") != list(DOF_NAMES):
        raise BundleError(f"{path}: trained for another hand; expected angles are {', '.join(DOF_NAMES)}")
    return meta


def _read_pose(folder: Path, meta: dict[str, Any]) -> tuple[Array, Array, float]:
    try:
        rest = np.array(meta["rest_angles_rad"], dtype=np.float64)
        limits = np.array(meta["limits_rad"], dtype=np.float64)
        response = float(meta["response"])
    except (KeyError, TypeError, ValueError):
        raise BundleError(
            f"{folder / 'bundle.json'}: needs rest_angles_rad (20,), limits_rad (20, 2) and response"
        ) from None
    good = rest.shape == (DOF_COUNT,) and limits.shape == (DOF_COUNT, 2)
    if not (good and np.all(limits[:, 0] <= rest) and np.all(rest <= limits[:, 1])):
        raise BundleError(f"{folder / 'bundle.json'}: rest_angles_rad (20,) must be inside limits_rad (20, 2)")
    if not 0.0 < response <= 1.0:
        raise BundleError(f"{folder / 'bundle.json'}: response is {response}, allowed is above 0 up to 1")
    return rest, limits, response
