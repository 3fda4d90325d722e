"""Bundles: where the network runs, and bundles that are refused with the reason."""

import logging
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
from other_hands import three_fingered
from tiny_bundle import write_tiny_bundle

from manipnet.synthesis.hand.hand_file import HAND_FILE, write_hand
from manipnet.synthesis.model.bundle import NETWORK_FILE, load_bundle, write_bundle
from manipnet.synthesis.model.layout import layout_of
from manipnet.synthesis.model.shipped import BundleError, shipped_hand

HAND = shipped_hand()
LAYOUT = layout_of(HAND)

HAS_CUDA = "CUDAExecutionProvider" in onnxruntime.get_available_providers()


@pytest.mark.skipif(HAS_CUDA, reason="this machine's ONNX Runtime has CUDA")
def test_without_cuda_the_processor_is_used_and_the_log_says_why(tiny_bundle: Path, caplog) -> None:
    rows = np.random.default_rng(0).normal(size=(3, LAYOUT.input_size)).astype(np.float32)
    wanted = load_bundle(tiny_bundle, "cpu").infer(rows)
    with caplog.at_level(logging.WARNING):
        bundle = load_bundle(tiny_bundle, "cuda")
    assert "manipnet-live[gpu]" in caplog.text
    assert "processor" in caplog.text
    assert bundle.provider == "cpu"
    np.testing.assert_array_equal(bundle.infer(rows), wanted)


def test_the_log_is_silent_unless_a_gpu_was_requested(tiny_bundle: Path, caplog) -> None:
    with caplog.at_level(logging.WARNING):
        assert load_bundle(tiny_bundle, "auto").provider in ("cpu", "cuda")
        assert load_bundle(tiny_bundle, "cpu").provider == "cpu"
    assert HAS_CUDA or caplog.text == ""


def test_a_network_has_one_thread(tiny_bundle: Path) -> None:
    options = load_bundle(tiny_bundle).session.get_session_options()
    assert options.intra_op_num_threads == options.inter_op_num_threads == 1
    assert options.execution_mode == onnxruntime.ExecutionMode.ORT_SEQUENTIAL


def test_endlessly_nested_json_is_refused(tiny_bundle: Path, tmp_path: Path) -> None:
    folder = tmp_path / "nested"
    shutil.copytree(tiny_bundle, folder)
    (folder / "bundle.json").write_text('{"format": ' * 100_000)
    with pytest.raises(BundleError, match="not JSON"):
        load_bundle(folder)


def test_a_hand_that_messages_cannot_carry_is_refused_by_name(tmp_path: Path) -> None:
    folder = write_tiny_bundle(tmp_path / "three", hand=three_fingered(HAND))
    with pytest.raises(BundleError, match="the hand 'three fingers' does not fit the hands messages: it has 14 joints"):
        load_bundle(folder)


def test_another_hand_beside_a_model_is_refused(tiny_bundle: Path, tmp_path: Path) -> None:
    folder = tmp_path / "mixed"
    shutil.copytree(tiny_bundle, folder)
    write_hand(three_fingered(HAND), folder / HAND_FILE)
    with pytest.raises(BundleError, match=r"hand\.npz: the hand 'three fingers' does not fit"):
        load_bundle(folder)
    (folder / HAND_FILE).unlink()
    with pytest.raises(BundleError, match=r"hand\.npz: cannot be read"):
        load_bundle(folder)


def test_the_hash_is_of_the_network_the_hand_and_the_pose(tiny_bundle: Path, tmp_path: Path) -> None:
    bundle = load_bundle(tiny_bundle)
    folders = {name: tmp_path / name for name in ("copy", "hand", "limits", "network")}
    for folder in folders.values():
        shutil.copytree(tiny_bundle, folder)
    write_hand(replace(HAND, radii=1.1 * HAND.radii), folders["hand"] / HAND_FILE)
    narrower = bundle.meta | {"limits_rad": (0.9 * bundle.limits).tolist()}
    write_bundle(folders["limits"], (tiny_bundle / NETWORK_FILE).read_bytes(), HAND, narrower)
    write_tiny_bundle(folders["network"], spread=2e-3)
    hashes = {name: load_bundle(folder).model_hash for name, folder in folders.items()}
    assert hashes["copy"] == bundle.model_hash
    assert len({bundle.model_hash, *hashes.values()}) == len(folders)
