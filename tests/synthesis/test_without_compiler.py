"""With `NUMBA_DISABLE_JIT=1` the kernels run as plain Python, so that a debugger can step through them."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

PATIENCE_S = 300.0
ONE_TICK = """
import json, sys
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.model.features import features
from manipnet.synthesis.objects.library import load_library_mesh
from manipnet.synthesis.objects.shape import build_shape
from manipnet.synthesis.synthesizer import Synthesizer, windows_of
from written_scene import scenes_at

bundle, shape = load_bundle(sys.argv[1]), build_shape(load_library_mesh("cube"))
synthesizer, scene = Synthesizer(bundle, sys.argv[2]), scenes_at(3, [shape, shape])[0]
state = synthesizer.rest_state()
row = features(bundle.hand, shape, windows_of([scene]), state.positions[None], state.rotations[None])[0]
(step,) = synthesizer.step([scene], [state])
print(json.dumps({"features": row.tolist(), "angles": step.angles.tolist(), "distances": step.distances.tolist()}))
"""
"""The features and the pose of one hand at a cube whose shape is prebuilt."""


def one_tick(bundle: Path, solver: str, **environment: str) -> dict[str, np.ndarray]:
    support = str(Path(__file__).parents[1] / "support")
    path = os.pathsep.join([support, *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-c", ONE_TICK, str(bundle), solver],
        env={**os.environ, "PYTHONPATH": path, **environment},
        stdout=subprocess.PIPE,
        check=True,
        timeout=PATIENCE_S,
    )
    return {name: np.array(values) for name, values in json.loads(done.stdout).items()}


@pytest.mark.parametrize("solver", ["least_squares", "ccd", "none"])
def test_a_tick_in_plain_python_is_that_of_the_compiled_kernels(tiny_bundle: Path, solver: str) -> None:
    compiled, plain = one_tick(tiny_bundle, solver), one_tick(tiny_bundle, solver, NUMBA_DISABLE_JIT="1")
    for name, values in compiled.items():
        np.testing.assert_allclose(plain[name], values, atol=2e-5, err_msg=name)
