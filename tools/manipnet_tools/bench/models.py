"""The models that are timed: the shipped small one, and the paper's width in single precision and quantised."""

from dataclasses import dataclass, replace

import numpy as np

from manipnet.synthesis.model.bundle import Bundle, BundleError, load_bundle, open_session
from manipnet_tools.bench.reference import full_graph

FULL = "manipnet-full-int8"


@dataclass(frozen=True)
class FullWidth:
    """The paper's width in single precision with random weights: its graph, and a bundle of it."""

    content: bytes
    bundle: Bundle


def full_width(small: Bundle) -> FullWidth:
    """Random weights in the company of the `small` bundle's pose; a tick costs what it would with trained ones.

    Raises `ModuleNotFoundError` without the onnx to make a graph.
    """
    graph = full_graph(small.hand, small.rest_angles)
    return FullWidth(graph, replace(small, name="full width", session=open_session("full width", graph, small.layout)))


def shipped_full_width() -> Bundle | None:
    """The full-width bundle of this installation, if it has one."""
    try:
        return load_bundle(FULL)
    except BundleError:
        return None


def quantised(full: FullWidth) -> Bundle:
    """The same with 8-bit weights. Raises `ModuleNotFoundError` without onnx."""
    from manipnet_tools.training.quantise import quantise_weights

    session = open_session("quantised", quantise_weights(full.content), full.bundle.layout)
    return replace(full.bundle, name="full width, quantised", session=session)


def apart_m(a: Bundle, b: Bundle, rows: np.ndarray) -> float:
    """The largest distance between the joints of two bundles on the same feature `rows (N, input_size)`, metres."""
    difference = a.infer(rows) - b.infer(rows)
    joints = difference[:, a.layout.output["joint_positions"].columns].reshape(len(rows), -1, 3)
    return float(np.linalg.norm(joints, axis=-1).max())
