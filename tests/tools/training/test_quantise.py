# ruff: noqa: E402
"""Quantised weights change the answers only a little."""

import numpy as np
import pytest

onnx = pytest.importorskip("onnx", reason="onnx is not installed: python -m pip install onnx")

from manipnet.synthesis.model.bundle import open_session
from manipnet.synthesis.model.layout import layout_of
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.bench.reference import full_graph
from manipnet_tools.training import quantise

HAND = shipped_hand()
LAYOUT = layout_of(HAND)

WIDTH = 192


@pytest.fixture(scope="module")
def graph() -> bytes:
    return full_graph(HAND, np.zeros(20), WIDTH)


def _answers(graph: bytes, rows: np.ndarray) -> np.ndarray:
    return np.asarray(open_session("graph", graph, LAYOUT).run(None, {"features": rows})[0])


def test_wide_layers_answer_nearly_the_same_in_4_bits(graph: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = np.random.default_rng(0).normal(size=(8, LAYOUT.input_size)).astype(np.float32)
    exact = _answers(graph, rows)
    error = {}
    for wide in (1024, 128):
        monkeypatch.setattr(quantise, "_WIDE", wide)
        error[wide] = np.abs(exact - _answers(quantise.quantise_weights(graph), rows)).mean() / exact.std(axis=0).mean()
    assert error[1024] < 0.03
    assert error[1024] < error[128] < 0.2


def test_one_large_input_does_not_coarsen_the_others(graph: bytes) -> None:
    rows = np.random.default_rng(0).normal(size=(8, LAYOUT.input_size)).astype(np.float32)
    rows[:, 1000] = 60.0
    exact, quantised = _answers(graph, rows), _answers(quantise.quantise_weights(graph), rows)
    error = exact - quantised
    assert error.std(axis=0).mean() < 0.03 * exact.std(axis=0).mean()


@pytest.mark.parametrize("wide", [1024, 128])
def test_weights_change_by_at_most_one_level(graph: bytes, wide: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(quantise, "_WIDE", wide)
    model = onnx.load_from_string(quantise.quantise_weights(graph))
    stored = {tensor.name: onnx.numpy_helper.to_array(tensor) for tensor in model.graph.initializer}
    before = onnx.load_from_string(graph).graph.initializer
    weights = {t.name: onnx.numpy_helper.to_array(t) for t in before if t.name.endswith(".weight")}
    assert len(weights) == 8
    for name, exact in weights.items():
        levels, scales = stored[f"{name}_levels"], stored[f"{name}_scales"]
        zero = 128.0
        if min(exact.shape) >= wide:
            levels, zero = np.stack([levels & 15, levels >> 4], axis=-1).reshape(*scales.shape, 32), 8.0
        again = ((levels.astype(np.float32) - zero) * scales[..., None]).reshape(len(exact), -1)
        np.testing.assert_allclose(again[:, : exact.shape[1]], exact, atol=1.01 * np.abs(scales).max())
        assert np.all(again[:, exact.shape[1] :] == 0.0)


def test_a_graph_that_cannot_be_quantised_is_refused(graph: bytes) -> None:
    model = onnx.load_from_string(graph)
    gemm = next(node for node in model.graph.node if node.op_type == "Gemm")
    gemm.attribute.append(onnx.helper.make_attribute("alpha", 2.0))
    with pytest.raises(ValueError, match="can be quantised"):
        quantise.quantise_weights(model.SerializeToString())
