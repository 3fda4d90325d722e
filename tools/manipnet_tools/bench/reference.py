"""What everything is measured against: the paper's network alone, 1536 wide, single precision, one thread."""

from collections.abc import Callable

import numpy as np
import onnxruntime

from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.bundle import open_session
from manipnet.synthesis.model.features import pose_outputs
from manipnet.synthesis.model.layout import ENCODED, INPUT_SIZE, OUTPUT_SIZE

WIDTH = 1536
HANDS = 2


def full_graph(rest_angles: np.ndarray, width: int = WIDTH) -> bytes:
    """The network of the paper as ONNX with random weights, answering nearly the pose of `rest_angles (20,)`.

    Three linear encoders, two residual dense blocks, a linear decoder, normalisation before and after. Needs onnx.
    """
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    rng = np.random.default_rng(0)
    nodes, weights = [], []

    def constant(name: str, values: np.ndarray) -> str:
        weights.append(numpy_helper.from_array(np.asarray(values, np.float32), name))
        return name

    def node(kind: str, inputs: list[str], output: str, **attributes: int) -> str:
        nodes.append(helper.make_node(kind, inputs, [output], None, None, None, None, **attributes))
        return output

    def dense(x: str, name: str, size: int, wide: int, gain: float = 1.0) -> str:
        w = constant(f"{name}.weight", gain * rng.normal(size=(wide, size)) / np.sqrt(size))
        return node("Gemm", [x, w, constant(f"{name}.bias", np.zeros(wide))], name, transB=1)

    def block(x: str, name: str) -> str:
        a = node("Relu", [x], f"{name}.a")
        h = node("Add", [dense(a, f"{name}.first", width, width, 0.3), a], f"{name}.h")
        c = node("Relu", [h], f"{name}.c")
        y = node("Add", [dense(c, f"{name}.second", width, width, 0.3), c], f"{name}.y")
        return node("Add", [y, a], f"{name}.out")

    centred = node("Sub", ["features", constant("input_mean", np.zeros(INPUT_SIZE))], "centred")
    x = node("Mul", [centred, constant("input_gain", np.ones(INPUT_SIZE))], "x")
    sizes = [columns.stop - columns.start for columns in ENCODED.values()]
    weights.append(numpy_helper.from_array(np.array(sizes, np.int64), "sizes"))
    nodes.append(helper.make_node("Split", [x, "sizes"], list(ENCODED), axis=1))
    parts = [dense(name, f"{name}.code", size, width // 3) for name, size in zip(ENCODED, sizes, strict=True)]
    decoded = dense(block(block(node("Concat", parts, "codes", axis=1), "one"), "two"), "decoded", width, OUTPUT_SIZE)
    scaled = node("Mul", [decoded, constant("output_std", np.full(OUTPUT_SIZE, 1e-4))], "scaled")
    node("Add", [scaled, constant("output_mean", _answer(rest_angles))], "outputs")
    graph = helper.make_graph(
        nodes,
        "manipnet",
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, ["hands", INPUT_SIZE])],
        [helper.make_tensor_value_info("outputs", TensorProto.FLOAT, ["hands", OUTPUT_SIZE])],
        weights,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.checker.check_model(model)
    return model.SerializeToString()


def _answer(angles: np.ndarray) -> np.ndarray:
    """Outputs `(220,)` that say a pose, 2 cm from everything."""
    positions, rotations = forward_kinematics(angles[None])
    return pose_outputs(positions, rotations, np.full((1, 22), 0.02))[0]


def forward_pass(content: bytes) -> Callable[[], object]:
    """One run of a graph alone for two hands on one thread, on features that never change."""
    session: onnxruntime.InferenceSession = open_session("reference", content)
    rows = np.random.default_rng(1).normal(size=(HANDS, INPUT_SIZE)).astype(np.float32)
    return lambda: session.run(None, {"features": rows})
