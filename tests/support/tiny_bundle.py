"""A bundle without training: it always proposes nearly the same pose, and runs in no time."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.skeleton import DOF_LIMITS_RAD, DOF_NAMES, PARENTS
from manipnet.synthesis.model.bundle import FORMAT
from manipnet.synthesis.model.layout import INPUT_SIZE, OUTPUT, OUTPUT_SIZE, describe


def write_tiny_bundle(folder: Path, spread: float = 1e-3) -> Path:
    """A bundle whose network is a random map of rank 4 around a half-closed hand; `spread` scales the map."""
    onnx = pytest.importorskip("onnx", reason="onnx is not installed: python -m pip install onnx")
    helper, from_array = onnx.helper, onnx.numpy_helper.from_array
    rng = np.random.default_rng(7)
    weights = {
        "narrow": rng.normal(size=(INPUT_SIZE, 4)) / np.sqrt(INPUT_SIZE),
        "wide": spread * rng.normal(size=(4, OUTPUT_SIZE)),
        "bias": _output_of(DOF_LIMITS_RAD @ [0.6, 0.4]),
    }
    graph = helper.make_graph(
        [
            helper.make_node("MatMul", ["features", "narrow"], ["few"]),
            helper.make_node("Tanh", ["few"], ["bounded"]),
            helper.make_node("MatMul", ["bounded", "wide"], ["many"]),
            helper.make_node("Add", ["many", "bias"], ["outputs"]),
        ],
        "tiny",
        [helper.make_tensor_value_info("features", onnx.TensorProto.FLOAT, ["hands", INPUT_SIZE])],
        [helper.make_tensor_value_info("outputs", onnx.TensorProto.FLOAT, ["hands", OUTPUT_SIZE])],
        [from_array(value.astype(np.float32), name) for name, value in weights.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    content = model.SerializeToString()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "manipnet.onnx").write_bytes(content)
    meta = {
        "format": FORMAT,
        "layout": describe(),
        "dofs": list(DOF_NAMES),
        "rest_angles_rad": (DOF_LIMITS_RAD @ [0.7, 0.3]).tolist(),
        "response": 0.5,
        "limits_rad": DOF_LIMITS_RAD.tolist(),
        "model_sha256": hashlib.sha256(content).hexdigest(),
    }
    (folder / "bundle.json").write_text(json.dumps(meta))
    return folder


def _output_of(angles: np.ndarray) -> np.ndarray:
    """The network output `(220,)` that means the pose of `angles`, 2 cm from everything."""
    positions, rotations = forward_kinematics(angles)
    bones = np.concatenate([rotations, rotations[PARENTS[17:]]])
    output = np.full(OUTPUT_SIZE, 0.02)
    output[OUTPUT["joint_positions"].columns] = positions.reshape(-1)
    output[OUTPUT["joint_axes"].columns] = bones[:, :, :2].transpose(0, 2, 1).reshape(-1)
    return output
