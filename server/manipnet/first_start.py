"""The first start of an installation, when nothing is compiled yet: a second process compiles what the hands sense with
while the first one imports, builds shapes and compiles the rest.

Run as a module it is that second process; what it compiled it leaves in the cache.
"""

import subprocess
import sys

from manipnet.kernels import cached


def compile_sensing() -> None:
    """Compile the kernels of the features, by computing some."""
    import numpy as np

    from manipnet.network.features import features
    from manipnet.objects.library import load_library_mesh
    from manipnet.objects.shape import build_shape
    from manipnet.synthesis import HandScene, state_of, windows_of

    rest = state_of(np.zeros(20))
    still = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (21, 1))
    scene = HandScene("right", still, still, still, build_shape(load_library_mesh("cube")))
    features(scene.shape, windows_of([scene]), rest.positions[None], rest.rotations[None])


class Helper:
    """The second process, if one is needed."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Let it begin, unless everything is in the cache."""
        if not cached("_all_but_readings"):
            quiet = subprocess.DEVNULL
            command = [sys.executable, "-m", "manipnet.first_start"]
            self._process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet)

    def wait(self) -> None:
        """Until it is done. Where it failed, whoever needs a kernel compiles it."""
        if self._process is not None:
            self._process.wait()


if __name__ == "__main__":
    compile_sensing()
