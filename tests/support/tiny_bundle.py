"""A bundle without training: its network always answers with nearly the same pose, in no time."""

from pathlib import Path

import numpy as np
import pytest

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.bundle import write_bundle
from manipnet.synthesis.model.features import pose_outputs
from manipnet.synthesis.model.layout import layout_of
from manipnet.synthesis.model.shipped import shipped_hand


def write_tiny_bundle(folder: Path, spread: float = 1e-3, hand: Hand | None = None) -> Path:
    """Write a bundle of a hand, by default the shipped one, that answers with a half-closed hand."""
    hand = hand or shipped_hand()
    return _write(folder, hand, tiny_network(hand, spread), hand.limits @ [0.7, 0.3])


def write_still_bundle(folder: Path, angles: Array) -> Path:
    """Write a bundle of the shipped hand that always answers with `angles (A,)`, far from any surface."""
    hand = shipped_hand()
    network = tiny_network(hand, spread=0.0, angles=angles, distance_m=1.0)
    return _write(folder, hand, network, np.zeros(hand.angle_count))


def _write(folder: Path, hand: Hand, network: bytes, rest_angles: Array) -> Path:
    pose = {"rest_angles_rad": rest_angles.tolist(), "limits_rad": hand.limits.tolist(), "response": 0.5}
    write_bundle(folder, network, hand, pose)
    return folder


def tiny_network(hand: Hand, spread: float = 1e-3, angles: Array | None = None, distance_m: float = 0.02) -> bytes:
    """An ONNX graph that answers with `angles`, by default half closed, `distance_m` from every surface.

    To this it adds a random map of rank 4 of the features, which `spread` scales.
    """
    onnx = pytest.importorskip("onnx", reason="onnx is not installed: python -m pip install onnx")
    helper, from_array = onnx.helper, onnx.numpy_helper.from_array
    layout, rng = layout_of(hand), np.random.default_rng(7)
    positions, rotations = forward_kinematics(hand, (hand.limits @ [0.6, 0.4] if angles is None else angles)[None])
    weights = {
        "narrow": rng.normal(size=(layout.input_size, 4)) / np.sqrt(layout.input_size),
        "wide": spread * rng.normal(size=(4, layout.output_size)),
        "bias": pose_outputs(hand, positions, rotations, np.full((1, hand.joint_count), distance_m))[0],
    }
    graph = helper.make_graph(
        [
            helper.make_node("MatMul", ["features", "narrow"], ["few"]),
            helper.make_node("Tanh", ["few"], ["bounded"]),
            helper.make_node("MatMul", ["bounded", "wide"], ["many"]),
            helper.make_node("Add", ["many", "bias"], ["outputs"]),
        ],
        "tiny",
        [helper.make_tensor_value_info("features", onnx.TensorProto.FLOAT, ["hands", layout.input_size])],
        [helper.make_tensor_value_info("outputs", onnx.TensorProto.FLOAT, ["hands", layout.output_size])],
        [from_array(value.astype(np.float32), name) for name, value in weights.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    return model.SerializeToString()
