"""Makes the models that are timed beside the shipped one: the paper's width, in single precision and quantised."""

from dataclasses import dataclass, replace

import numpy as np

from manipnet.synthesis.model.bundle import Bundle, load_bundle, open_session
from manipnet.synthesis.model.shipped import BundleError
from manipnet_tools.bench.reference import full_graph

FULL = "manipnet-full-int8"


@dataclass(frozen=True)
class FullWidth:
    """A network of the paper's width in single precision, with random weights: its graph, and a bundle with it."""

    content: bytes
    bundle: Bundle


def full_width(small: Bundle) -> FullWidth:
    """A copy of the `small` bundle whose network has the paper's width and random weights.

    A tick with it costs as much as with trained weights. Raises `ModuleNotFoundError` if onnx is not installed.
    """
    graph = full_graph(small.hand, small.rest_angles)
    return FullWidth(graph, replace(small, name="full width", session=open_session("full width", graph, small.layout)))


def shipped_full_width() -> Bundle | None:
    """The full-width bundle of this installation, or None."""
    try:
        return load_bundle(FULL)
    except BundleError:
        return None


def quantised(full: FullWidth) -> Bundle:
    """The same bundle with quantised weights. Raises `ModuleNotFoundError` if onnx is not installed."""
    from manipnet_tools.training.quantise import quantise_weights

    session = open_session("quantised", quantise_weights(full.content), full.bundle.layout)
    return replace(full.bundle, name="full width, quantised", session=session)


def apart_m(a: Bundle, b: Bundle, rows: np.ndarray) -> float:
    """The largest distance in metres between the joints of two bundles for the same feature `rows (N, input_size)`."""
    difference = a.infer(rows) - b.infer(rows)
    joints = difference[:, a.layout.output["joint_positions"].columns].reshape(len(rows), -1, 3)
    return float(np.linalg.norm(joints, axis=-1).max())
