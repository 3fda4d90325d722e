"""Real takes, and a model without training for what is not about the model."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from manipnet.synthesis.hand.hand_file import HAND_FILE, write_hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.bundle import FORMAT
from manipnet.synthesis.model.features import pose_outputs
from manipnet.synthesis.model.layout import layout_of
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.evaluation.cases import Case, load_cases

HAND = shipped_hand()
LAYOUT = layout_of(HAND)

TAKES = ("cyl_med3", "mug1")
STILL_ANGLES = np.clip(np.full(20, 0.2), HAND.limits[:, 0], HAND.limits[:, 1])


@pytest.fixture(scope="session")
def cases(manipnet_data) -> dict[str, Case]:
    """Two real takes by name."""
    return {case.name: case for case in load_cases(manipnet_data, TAKES)}


@pytest.fixture(scope="session")
def still_model(tmp_path_factory) -> Path:
    """A bundle whose network answers `STILL_ANGLES`, far from any surface, whatever it is shown."""
    onnx = pytest.importorskip("onnx", reason="the extra `train` makes test models")
    positions, rotations = forward_kinematics(HAND, STILL_ANGLES[None])
    answer = pose_outputs(HAND, positions, rotations, np.full((1, 22), 1.0))[0]
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    graph = helper.make_graph(
        [
            helper.make_node("MatMul", ["features", "nothing"], ["zero"]),
            helper.make_node("Add", ["zero", "answer"], ["pose"]),
        ],
        "still",
        [helper.make_tensor_value_info("features", kind, ["n", LAYOUT.input_size])],
        [helper.make_tensor_value_info("pose", kind, ["n", LAYOUT.output_size])],
        [
            onnx.numpy_helper.from_array(np.zeros((LAYOUT.input_size, LAYOUT.output_size), np.float32), "nothing"),
            onnx.numpy_helper.from_array(answer.astype(np.float32), "answer"),
        ],
    )
    opset = [helper.make_opsetid("", 17)]
    content = helper.make_model(graph, opset_imports=opset, ir_version=9).SerializeToString()
    folder = tmp_path_factory.mktemp("still")
    (folder / "manipnet.onnx").write_bytes(content)
    meta = {
        "format": FORMAT,
        "layout": LAYOUT.describe(),
        "angle_names": list(HAND.angle_names),
        "rest_angles_rad": [0.0] * 20,
        "limits_rad": HAND.limits.tolist(),
        "response": 0.5,
        "model_sha256": hashlib.sha256(content).hexdigest(),
    }
    (folder / "bundle.json").write_text(json.dumps(meta))
    write_hand(HAND, folder / HAND_FILE)
    return folder
