"""A model bundle: a folder with a trained network and the hand it was trained for.

`manipnet.onnx` is the network with its normalisation inside, `bundle.json` says what it expects, `hand.npz` is the
hand, `CARD.md` is for people.
"""

import hashlib
import json
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import onnxruntime

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.hand_file import HAND_FILE, read_hand, write_hand
from manipnet.synthesis.hand.validation import HandError
from manipnet.synthesis.model.layout import Layout, layout_of
from manipnet.synthesis.model.providers import DEFAULT_MODEL, Provider
from manipnet.synthesis.model.shipped import BundleError, find_bundle
from manipnet.wire.hand_names import misfit

FORMAT = 2
NETWORK_FILE: Final = "manipnet.onnx"
META_FILE: Final = "bundle.json"
_CPU, _CUDA = "CPUExecutionProvider", "CUDAExecutionProvider"
_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Bundle:
    """A trained model, ready to run."""

    name: str
    hand: Hand
    """The hand that the network poses."""
    layout: Layout
    """Of the network's inputs and outputs."""
    rest_angles: Array
    """`(A,)` neutral pose, radians."""
    limits: Array
    """`(A, 2)` limits of the angles in the poses it was trained on, radians."""
    response: float
    """Share of the way to the network's pose that a hand goes in one tick, in (0, 1]; its poses lead by that lag."""
    meta: dict[str, Any]
    """The content of `bundle.json`."""
    model_hash: str
    """SHA-256 of all that the synthesis depends on: network, hand, and `bundle.json` with its pose and limits."""
    session: onnxruntime.InferenceSession
    folder: Path

    @property
    def provider(self) -> Provider:
        """What it runs on, `cpu` or `cuda`."""
        return "cuda" if self.session.get_providers()[0] == _CUDA else "cpu"

    def infer(self, rows: np.ndarray) -> np.ndarray:
        """Network outputs `(N, output_size)` of feature rows `(N, input_size)` float32, both in SI units."""
        infer, outputs = self.bind(np.ascontiguousarray(rows, np.float32))
        infer()
        return outputs

    def bind(self, rows: np.ndarray) -> tuple[Callable[[], object], np.ndarray]:
        """A function that runs the network on what is then in `rows`, and the outputs that it fills, as in `infer`.

        In a running server this takes a tenth less time than to pass the rows, which must be contiguous, at each tick.
        """
        outputs = np.empty((len(rows), self.layout.output_size), np.float32)
        binding = self.session.io_binding()
        binding.bind_cpu_input(self.session.get_inputs()[0].name, rows)
        binding.bind_output(
            self.session.get_outputs()[0].name, "cpu", 0, np.float32, outputs.shape, outputs.ctypes.data
        )
        return partial(self.session.run_with_iobinding, binding), outputs


def load_bundle(model: Path | str = DEFAULT_MODEL, provider: Provider = "cpu") -> Bundle:
    """Load a bundle by its folder or by the name of a shipped one. Raises `BundleError`.

    If a GPU was requested and cannot be used, a line of the log says why and the network runs on the processor.
    """
    folder = find_bundle(model)
    hand = _read_hand(folder / HAND_FILE)
    layout = layout_of(hand)
    meta = _read_meta(folder / META_FILE, hand, layout)
    path = folder / NETWORK_FILE
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BundleError(f"{path}: cannot be read ({error.strerror})") from None
    if meta.get("model_sha256") != hashlib.sha256(content).hexdigest():
        raise BundleError(f"{path}: its hash is not the one in bundle.json; the bundle is damaged, copy it again")
    session = open_session(path, content, layout, provider)
    pose = _read_pose(folder / META_FILE, meta, hand)
    return Bundle(folder.name, hand, layout, *pose, meta, _hash_of(folder), session, folder)


def write_bundle(folder: Path, network: bytes, hand: Hand, meta: Mapping[str, Any]) -> None:
    """Write a bundle that `load_bundle` accepts: an ONNX graph, its hand, and the rest of `bundle.json` as `meta`.

    `meta` needs `rest_angles_rad`, `limits_rad` and `response`; everything else in it is kept. Raises `OSError`.
    """
    described = {
        "format": FORMAT,
        "layout": layout_of(hand).describe(),
        "angle_names": list(hand.angle_names),
        "model_sha256": hashlib.sha256(network).hexdigest(),
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / NETWORK_FILE).write_bytes(network)
    write_hand(hand, folder / HAND_FILE)
    (folder / META_FILE).write_text(json.dumps({**meta, **described}, indent=1) + "\n", encoding="utf-8")


def _hash_of(folder: Path) -> str:
    digests = [hashlib.sha256((folder / name).read_bytes()).digest() for name in (NETWORK_FILE, HAND_FILE, META_FILE)]
    return hashlib.sha256(b"".join(digests)).hexdigest()


def open_session(
    path: Path | str, content: bytes, layout: Layout, provider: Provider = "cpu"
) -> onnxruntime.InferenceSession:
    """Open a graph on one thread. Raises `BundleError`, which names `path`, for one that does not fit the layout."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    providers = _providers(provider)
    try:
        session = onnxruntime.InferenceSession(content, options, providers=providers)
    except Exception as error:  # the runtime raises many kinds of its own for a bad graph
        raise BundleError(f"{path}: not a model this runtime can open ({error})") from None
    if session.get_providers()[0] != providers[0]:
        _log.warning("CUDA could not be started (driver or CUDA libraries missing); the network runs on the processor")
    sizes = [node.shape[-1] for node in (*session.get_inputs(), *session.get_outputs())]
    expected = [layout.input_size, layout.output_size]
    if sizes != expected:
        raise BundleError(f"{path}: has {sizes} inputs and outputs; expected are {expected}")
    return session


def _providers(requested: Provider) -> list[str]:
    """ONNX Runtime's names, the preferred one first."""
    if requested != "cpu" and _CUDA in onnxruntime.get_available_providers():
        return [_CUDA, _CPU]
    if requested == "cuda":
        _log.warning(
            "the provider cuda is not installed (python -m pip install 'manipnet-live[gpu]'); the network runs on the "
            "processor"
        )
    return [_CPU]


def _read_hand(path: Path) -> Hand:
    try:
        hand = read_hand(path)
    except HandError as error:
        raise BundleError(str(error)) from None
    if reason := misfit(hand.joint_names, hand.angle_names):
        raise BundleError(f"{path}: the hand {hand.name!r} does not fit the hands messages: {reason}")
    return hand


def _read_meta(path: Path, hand: Hand, layout: Layout) -> dict[str, Any]:
    try:
        meta = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BundleError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError) as error:
        raise BundleError(f"{path}: not JSON ({error})") from None
    if not isinstance(meta, dict) or meta.get("format") != FORMAT:
        found = meta.get("format") if isinstance(meta, dict) else None
        raise BundleError(f"{path}: bundle format {found!r}, this version reads {FORMAT}; train or download it again")
    if meta.get("layout") != layout.describe():
        raise BundleError(f"{path}: trained for another feature layout than this version's; train it again")
    if meta.get("angle_names") != list(hand.angle_names):
        raise BundleError(f"{path}: trained for another hand; {HAND_FILE} has the angles {', '.join(hand.angle_names)}")
    return meta


def _read_pose(path: Path, meta: dict[str, Any], hand: Hand) -> tuple[Array, Array, float]:
    count = hand.angle_count
    try:
        rest = np.array(meta["rest_angles_rad"], dtype=np.float64)
        limits = np.array(meta["limits_rad"], dtype=np.float64)
        response = float(meta["response"])
    except (KeyError, TypeError, ValueError):
        raise BundleError(
            f"{path}: needs rest_angles_rad ({count},), limits_rad ({count}, 2) and response, all of them numbers"
        ) from None
    good = rest.shape == (count,) and limits.shape == (count, 2)
    if not (good and np.all(limits[:, 0] <= rest) and np.all(rest <= limits[:, 1])):
        raise BundleError(f"{path}: rest_angles_rad ({count},) must be inside limits_rad ({count}, 2)")
    if not 0.0 < response <= 1.0:
        raise BundleError(f"{path}: response is {response}; it must be above 0 and at most 1")
    return rest, limits, response
