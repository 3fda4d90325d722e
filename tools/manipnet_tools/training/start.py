"""Reads the network of a bundle back into torch, so that training can go on from it."""

from dataclasses import dataclass, replace

import numpy as np
import onnx
import torch
from onnx import numpy_helper

from manipnet.synthesis.model.bundle import NETWORK_FILE, Bundle, load_bundle
from manipnet.synthesis.model.shipped import BundleError, licence_of
from manipnet_tools.training.config import TrainConfig
from manipnet_tools.training.model import ManipNet, Normalisation
from manipnet_tools.training.quantise import single_precision
from manipnet_tools.training.sampler import Posed


@dataclass(frozen=True, eq=False)
class Start:
    """A trained network to go on from."""

    network: ManipNet
    posed: Posed
    """The hand whose bone frames the network knows."""
    licence: str
    """Its terms, which are also those of what is made of it."""
    bundle_hash: str
    """SHA-256 of the bundle."""


def read_start(model: str, config: TrainConfig) -> tuple[Start, TrainConfig]:
    """The network of a bundle, and the recipe with the bundle's architecture. Raises `BundleError`.

    The architecture, its width and the normalisation belong to the weights, so the bundle's own are used.
    """
    bundle = load_bundle(model)
    weights = _weights(bundle)
    recipe = bundle.meta.get("training", {})
    try:
        config = replace(
            config,
            width=len(weights["decoder.weight"][0]),
            architecture=recipe["architecture"],
            predict_change=recipe["predict_change"],
            hidden=tuple(recipe["hidden"]),
        )
        network = _network(bundle, weights, config)
    except (KeyError, RuntimeError, TypeError, ValueError) as error:
        raise BundleError(f"{bundle.folder}: is not a bundle of manipnet train ({error})") from None
    posed = Posed(bundle.hand, bundle.rest_angles)
    return Start(network, posed, licence_of(bundle.folder), bundle.model_hash), config


def _weights(bundle: Bundle) -> dict[str, np.ndarray]:
    """The named tensors of the graph in single precision. Raises `BundleError`."""
    content = (bundle.folder / NETWORK_FILE).read_bytes()
    graph = onnx.load_from_string(single_precision(content)).graph
    weights = {tensor.name: numpy_helper.to_array(tensor) for tensor in graph.initializer}
    if "decoder.weight" not in weights:
        original = "start from the bundle that it was made from"
        raise BundleError(f"{bundle.folder}: has quantised weights, from which training cannot go on; {original}")
    return weights


def _network(bundle: Bundle, weights: dict[str, np.ndarray], config: TrainConfig) -> ManipNet:
    inputs, outputs = (np.ones(size, np.float32) for size in (bundle.layout.input_size, bundle.layout.output_size))
    norm = Normalisation(inputs, inputs, outputs, outputs, config.predict_change)  # replaced by the bundle's own
    network = ManipNet(bundle.layout, norm, config.width, config.dropout, config.architecture, config.hidden)
    state = network.state_dict()
    network.load_state_dict({name: torch.from_numpy(weights[name].astype(np.float32)) for name in state})
    return network
