"""Without the compiler, as in a debugger, a tick computes the same."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from test_golden import FEATURES_WITHIN, LAYOUT, POSES_WITHIN, STORED, STRAY_RAYS

from manipnet.synthesis.objects.shape import build_shape
from manipnet_tools.bench.shapes import gourd

PROGRAM = """
import sys
from pathlib import Path
import numpy as np
from test_golden import compute
from manipnet.jit import kernel
from manipnet.synthesis.model.bundle import load_bundle
assert not hasattr(kernel(lambda: 0), "py_func"), "nothing is compiled"
bundle, cache, out = map(Path, sys.argv[1:])
np.savez(out, **compute(load_bundle(bundle), cache, 1))
"""


def test_a_tick_is_the_same_without_the_compiler(tiny_bundle: Path, tmp_path: Path) -> None:
    for triangles in (2000, 300):
        build_shape(gourd(triangles), tmp_path)  # the other process reads the shapes from here: building takes minutes
    env = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    out = tmp_path / "tick.npz"
    run = [sys.executable, "-W", "error", "-c", PROGRAM, str(tiny_bundle), str(tmp_path), str(out)]
    result = subprocess.run(run, env=env, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    with np.load(out, allow_pickle=False) as ours, np.load(STORED, allow_pickle=False) as stored:
        for name in stored.files:
            off = np.abs(ours[name][0] - stored[name][0])
            if name == "features":
                columns = LAYOUT.input["proximity"].columns
                assert (off[..., columns] > FEATURES_WITHIN).sum() <= STRAY_RAYS
                off[..., columns] = 0.0
            assert off.max() <= (FEATURES_WITHIN if name == "features" else POSES_WITHIN), name
