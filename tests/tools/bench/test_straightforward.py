"""The straightforward version of the benchmark computes the same as the product, so that their times compare."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from written_scene import scenes_at

from manipnet.synthesis.model.features import features
from manipnet.synthesis.model.layout import layout_of
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.shape import build_shape
from manipnet.synthesis.synthesizer import state_of, windows_of
from manipnet_tools.bench.shapes import gourd

HAND = shipped_hand()
LAYOUT = layout_of(HAND)

PATH = Path(__file__).parents[3] / "benchmarks" / "straightforward.py"
LOOKED_UP_M = 1.5e-3
"""Tolerance for distances far from the surface, which the product looks up in the distance field."""
BLOCKS = [name for name in LAYOUT.input if name not in ("ambient", "surface_normals")]


@pytest.fixture(scope="module")
def straightforward() -> ModuleType:
    pytest.importorskip("torch", reason="torch is not installed")
    spec = importlib.util.spec_from_file_location("straightforward", PATH)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules["straightforward"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_its_features_are_those_of_the_product(straightforward: ModuleType, tmp_path: Path) -> None:
    shape = build_shape(gourd(600), tmp_path)
    slow = straightforward.Straightforward(shape.mesh.vertices, shape.mesh.faces, 96)
    state = state_of(HAND, HAND.limits @ [0.6, 0.4])
    for scene in scenes_at(3, [shape, shape])[:2]:
        ours = features(HAND, shape, windows_of([scene]), state.positions[None], state.rotations[None])[0]
        theirs = slow.features(scene, state)
        for name in BLOCKS:
            apart = np.abs(ours - theirs)[LAYOUT.input[name].columns]
            assert np.quantile(apart, 0.99) < LOOKED_UP_M, name
        occupied = np.abs(ours - theirs)[LAYOUT.input["ambient"].columns] > 0.1
        assert occupied.mean() < 0.01, "only cells that the surface just touches may differ"
        assert np.quantile(np.abs(ours - theirs)[LAYOUT.input["surface_normals"].columns], 0.9) < 0.05


def test_it_runs_a_whole_tick(straightforward: ModuleType, tmp_path: Path) -> None:
    shape = build_shape(gourd(600), tmp_path)
    slow = straightforward.Straightforward(shape.mesh.vertices, shape.mesh.faces, 96)
    state = state_of(HAND, HAND.limits @ [0.6, 0.4])
    hands = slow.tick(scenes_at(3, [shape, shape])[:2], [state, state])
    assert np.isfinite(hands).all()
