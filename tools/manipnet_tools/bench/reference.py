"""The reference of all ratios: the paper's network alone, 1536 wide, in single precision and on one thread."""

from collections.abc import Callable

import numpy as np
import onnxruntime

from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.bundle import open_session
from manipnet.synthesis.model.features import pose_outputs
from manipnet.synthesis.model.layout import Layout, layout_of

WIDTH = 1536
HANDS = 2


def full_graph(hand: Hand, rest_angles: np.ndarray, width: int = WIDTH) -> bytes:
    """The network of the paper as ONNX, with random weights and outputs close to the pose of `rest_angles (A,)`.

    It has three linear encoders, two residual dense blocks and a linear decoder, with normalisation before and after.
    Raises `ModuleNotFoundError` if onnx is not installed.
    """
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    layout, rng = layout_of(hand), np.random.default_rng(0)
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

    centred = node("Sub", ["features", constant("input_mean", np.zeros(layout.input_size))], "centred")
    x = node("Mul", [centred, constant("input_gain", np.ones(layout.input_size))], "x")
    sizes = [columns.stop - columns.start for columns in layout.encoded.values()]
    weights.append(numpy_helper.from_array(np.array(sizes, np.int64), "sizes"))
    nodes.append(helper.make_node("Split", [x, "sizes"], list(layout.encoded), axis=1))
    parts = [dense(name, f"{name}.code", size, width // 3) for name, size in zip(layout.encoded, sizes, strict=True)]
    blocks = block(block(node("Concat", parts, "codes", axis=1), "one"), "two")
    decoded = dense(blocks, "decoded", width, layout.output_size)
    scaled = node("Mul", [decoded, constant("output_std", np.full(layout.output_size, 1e-4))], "scaled")
    node("Add", [scaled, constant("output_mean", _answer(hand, rest_angles))], "outputs")
    graph = helper.make_graph(
        nodes,
        "manipnet",
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, ["hands", layout.input_size])],
        [helper.make_tensor_value_info("outputs", TensorProto.FLOAT, ["hands", layout.output_size])],
        weights,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.checker.check_model(model)
    return model.SerializeToString()


def _answer(hand: Hand, angles: np.ndarray) -> np.ndarray:
    """Outputs `(output_size,)` for a pose that is 2 cm away from every surface."""
    positions, rotations = forward_kinematics(hand, angles[None])
    return pose_outputs(hand, positions, rotations, np.full((1, hand.joint_count), 0.02))[0]


def forward_pass(content: bytes, layout: Layout) -> Callable[[], object]:
    """A function that runs a graph once, for two hands, on one thread and always with the same features."""
    session: onnxruntime.InferenceSession = open_session("reference", content, layout)
    rows = np.random.default_rng(1).normal(size=(HANDS, layout.input_size)).astype(np.float32)
    return lambda: session.run(None, {"features": rows})
