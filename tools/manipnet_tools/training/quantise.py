"""Makes model files smaller: half-precision weights that are cast on load, or 8-bit weights, 4-bit in wide layers."""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from manipnet.synthesis.model.bundle import NETWORK_FILE, load_bundle, write_bundle
from manipnet_tools.training.options import QuantiseOptions

_LEAST_VALUES = 4096
"""Smaller tensors (biases, normalisation) keep full precision."""
_BLOCK = 32
"""Number of neighbouring weights, or activations, that share a scale. With 64 or 128, idle hands tremble more."""
_WIDE = 1024
"""Matrices of at least this size in both directions have 4 bits. With 4 bits, the narrow network errs a tenth more."""


def halve_weights(content: bytes) -> bytes:
    """The same graph with its matrices stored as float16; they are cast to float32 when it is loaded."""
    model = onnx.load_from_string(content)
    casts = []
    for tensor in model.graph.initializer:
        values = numpy_helper.to_array(tensor)
        if tensor.data_type != TensorProto.FLOAT or values.size < _LEAST_VALUES:
            continue
        name = tensor.name
        tensor.CopyFrom(numpy_helper.from_array(values.astype(np.float16), f"{name}_half"))
        casts.append(helper.make_node("Cast", [f"{name}_half"], [name], to=TensorProto.FLOAT))
    nodes = [*casts, *model.graph.node]
    del model.graph.node[:]
    model.graph.node.extend(nodes)
    onnx.checker.check_model(model)
    return model.SerializeToString()


def single_precision(content: bytes) -> bytes:
    """The graph before `halve_weights`, without casts; its float32 matrices have the precision that was kept."""
    model = onnx.load_from_string(content)
    stored = {tensor.name: tensor for tensor in model.graph.initializer}
    nodes = []
    for node in model.graph.node:
        if node.op_type == "Cast" and node.input[0] in stored:
            values = numpy_helper.to_array(stored[node.input[0]]).astype(np.float32)
            stored[node.input[0]].CopyFrom(numpy_helper.from_array(values, node.output[0]))
        else:
            nodes.append(node)
    del model.graph.node[:]
    model.graph.node.extend(nodes)
    onnx.checker.check_model(model)
    return model.SerializeToString()


def quantise_weights(content: bytes) -> bytes:
    """The same graph with 8-bit matrices, and 4-bit ones where they are wide.

    Blocks of 32 weights share a scale, and so do the activations that they meet, which are quantised to 8 bits at run
    time. One scale for a whole layer's activations, as in ONNX Runtime's `quantize_dynamic`, makes idle hands tremble.
    """
    model = onnx.load_from_string(content)
    stored = {tensor.name: tensor for tensor in model.graph.initializer}
    nodes = []
    for node in model.graph.node:
        if node.op_type == "Gemm":
            weights = numpy_helper.to_array(stored.pop(node.input[1]))
            outputs, inputs = weights.shape
            bits = 4 if min(outputs, inputs) >= _WIDE else 8
            levels, scales = _in_blocks(weights, bits)
            names = [f"{node.input[1]}_levels", f"{node.input[1]}_scales"]
            stored |= {n: numpy_helper.from_array(v, n) for n, v in zip(names, (levels, scales), strict=True)}
            node = _in_few_bits(node, outputs, inputs, bits, names)
        nodes.append(node)
    del model.graph.node[:], model.graph.initializer[:]
    model.graph.node.extend(nodes)
    model.graph.initializer.extend(stored.values())
    model.opset_import.append(helper.make_opsetid("com.microsoft", 1))
    onnx.checker.check_model(model)
    return model.SerializeToString()


def _in_blocks(weights: np.ndarray, bits: int) -> tuple[np.ndarray, np.ndarray]:
    """Weights `(N, K)` as levels `(N, blocks, 32)`, whose middle one means zero, and scales `(N, blocks)`.

    A byte holds two levels of 4 bits, the first in its lower half.
    """
    outputs, inputs = weights.shape
    blocks = -(-inputs // _BLOCK)
    padded = np.zeros((outputs, blocks * _BLOCK), np.float32)
    padded[:, :inputs] = weights
    padded = padded.reshape(outputs, blocks, _BLOCK)
    # the largest weight, whatever its sign, is level 0: there is one more level below zero than above it
    largest = np.take_along_axis(padded, np.abs(padded).argmax(axis=2, keepdims=True), axis=2)
    zero = 1 << (bits - 1)
    scales = np.where(largest == 0.0, 1.0, largest / -zero)
    levels = np.clip(np.round(padded / scales) + zero, 0, 2 * zero - 1).astype(np.uint8)
    if bits == 4:
        levels = levels[..., 0::2] | levels[..., 1::2] << 4
    return levels, scales[..., 0].astype(np.float32)


def _in_few_bits(gemm: onnx.NodeProto, outputs: int, inputs: int, bits: int, weights: list[str]) -> onnx.NodeProto:
    """ONNX Runtime's own node that does what a `Gemm` with weights `(outputs, inputs)` does."""
    attributes = {a.name: helper.get_attribute_value(a) for a in gemm.attribute}
    if attributes.pop("transB", 0) != 1 or any(value != 1.0 for value in attributes.values()):
        raise ValueError(f"{gemm.name}: only x Wᵀ + b can be quantised")
    activations_in_8_bits = 4
    return helper.make_node(
        "MatMulNBits",
        [gemm.input[0], *weights, "", "", gemm.input[2]],
        list(gemm.output),
        gemm.name,
        domain="com.microsoft",
        N=outputs,
        K=inputs,
        bits=bits,
        block_size=_BLOCK,
        accuracy_level=activations_in_8_bits,
    )


def run(options: QuantiseOptions) -> None:
    """Quantise a bundle and write it. Raises `BundleError`."""
    bundle = load_bundle(options.model)
    network = quantise_weights(single_precision((bundle.folder / NETWORK_FILE).read_bytes()))
    meta = bundle.meta | {"quantised_from_sha256": bundle.meta["model_sha256"]}
    write_bundle(options.out, network, bundle.hand, meta)
