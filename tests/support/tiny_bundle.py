"""A bundle without training: it always proposes nearly the same pose, and runs in no time."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from manipnet.synthesis.hand.hand_file import HAND_FILE, write_hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.bundle import FORMAT
from manipnet.synthesis.model.layout import layout_of
from manipnet.synthesis.model.shipped import shipped_hand

HAND = shipped_hand()
LAYOUT = layout_of(HAND)


def write_tiny_bundle(folder: Path, spread: float = 1e-3) -> Path:
    """A bundle whose network is a random map of rank 4 around a half-closed hand; `spread` scales the map."""
    onnx = pytest.importorskip("onnx", reason="onnx is not installed: python -m pip install onnx")
    helper, from_array = onnx.helper, onnx.numpy_helper.from_array
    rng = np.random.default_rng(7)
    weights = {
        "narrow": rng.normal(size=(LAYOUT.input_size, 4)) / np.sqrt(LAYOUT.input_size),
        "wide": spread * rng.normal(size=(4, LAYOUT.output_size)),
        "bias": _output_of(HAND.limits @ [0.6, 0.4]),
    }
    graph = helper.make_graph(
        [
            helper.make_node("MatMul", ["features", "narrow"], ["few"]),
            helper.make_node("Tanh", ["few"], ["bounded"]),
            helper.make_node("MatMul", ["bounded", "wide"], ["many"]),
            helper.make_node("Add", ["many", "bias"], ["outputs"]),
        ],
        "tiny",
        [helper.make_tensor_value_info("features", onnx.TensorProto.FLOAT, ["hands", LAYOUT.input_size])],
        [helper.make_tensor_value_info("outputs", onnx.TensorProto.FLOAT, ["hands", LAYOUT.output_size])],
        [from_array(value.astype(np.float32), name) for name, value in weights.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    content = model.SerializeToString()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "manipnet.onnx").write_bytes(content)
    meta = {
        "format": FORMAT,
        "layout": LAYOUT.describe(),
        "angle_names": list(HAND.angle_names),
        "rest_angles_rad": (HAND.limits @ [0.7, 0.3]).tolist(),
        "response": 0.5,
        "limits_rad": HAND.limits.tolist(),
        "model_sha256": hashlib.sha256(content).hexdigest(),
    }
    (folder / "bundle.json").write_text(json.dumps(meta))
    write_hand(HAND, folder / HAND_FILE)
    return folder


def _output_of(angles: np.ndarray) -> np.ndarray:
    """The network output `(220,)` that means the pose of `angles`, 2 cm from everything."""
    positions, rotations = forward_kinematics(HAND, angles)
    bones = np.concatenate([rotations, rotations[HAND.parents[17:]]])
    output = np.full(LAYOUT.output_size, 0.02)
    output[LAYOUT.output["joint_positions"].columns] = positions.reshape(-1)
    output[LAYOUT.output["joint_axes"].columns] = bones[:, :, :2].transpose(0, 2, 1).reshape(-1)
    return output
