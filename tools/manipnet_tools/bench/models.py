"""The models that are timed: the shipped small one, and the paper's width in single precision and in 8 bits."""

from dataclasses import dataclass, replace

import numpy as np

from manipnet.network.bundle import Bundle, BundleError, load_bundle, open_session
from manipnet.network.layout import OUTPUT
from manipnet_tools.bench.reference import full_graph

FULL = "manipnet-full"


@dataclass(frozen=True)
class FullWidth:
    """The paper's width in single precision: its graph, a bundle of it, and where its weights are from."""

    content: bytes
    bundle: Bundle
    origin: str


def full_width(small: Bundle) -> FullWidth:
    """The shipped full-width bundle if there is one, else random weights in the company of the `small` one's pose.

    Raises `ModuleNotFoundError` without the onnx to make a graph.
    """
    try:
        shipped = load_bundle(FULL)
    except BundleError:
        graph = full_graph(small.rest_angles)
        return FullWidth(graph, replace(small, name="full width", session=open_session("full width", graph)), "random")
    return FullWidth((shipped.folder / "manipnet.onnx").read_bytes(), shipped, "shipped")


def quantised(full: FullWidth) -> Bundle:
    """The same with 8-bit weights. Raises `ModuleNotFoundError` without onnx."""
    from manipnet_tools.compress import quantise_weights, single_precision

    session = open_session("8 bits", quantise_weights(single_precision(full.content)))
    return replace(full.bundle, name="full width, 8 bits", session=session)


def apart_m(a: Bundle, b: Bundle, rows: np.ndarray) -> float:
    """How far two bundles put any joint from each other at worst, on the same feature `rows (N, 2356)`; metres."""
    difference = a.infer(rows) - b.infer(rows)
    joints = difference[:, OUTPUT["joint_positions"].columns].reshape(len(rows), -1, 3)
    return float(np.linalg.norm(joints, axis=-1).max())
