"""The first start of an installation, when nothing is compiled yet: a second process compiles what hands sense with,
what builds shapes and some smaller kernels, while the first one imports and compiles inverse kinematics.

Run as a module it is that second process; what it compiled it leaves in the cache.
"""

import subprocess
import sys

from manipnet.jit import cached

SENSING = "_all_but_readings"
"""The kernel of `network.features` that takes longest to compile."""


def compile_aside() -> None:
    """Compile all kernels of a start and of a tick but the solver's, by using each once as they do."""
    import numpy as np

    from manipnet.synthesis.hand.kinematics import forward_kinematics
    from manipnet.synthesis.hand.limits import keep_angles
    from manipnet.synthesis.hand.openxr import pose_in_world
    from manipnet.synthesis.model.features import features
    from manipnet.synthesis.model.shipped import shipped_hand
    from manipnet.synthesis.objects.distance_field import build_field
    from manipnet.synthesis.objects.library import load_library_mesh
    from manipnet.synthesis.objects.shape import build_shape
    from manipnet.synthesis.synthesizer import HandScene, windows_of
    from manipnet.tracking.forecast import damped_velocity
    from manipnet.tracking.pose_buffer import PoseBuffer, sample

    still = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (21, 1))
    scene = HandScene("right", still, still, still, build_shape(load_library_mesh("cube")))
    build_field(scene.shape.bvh)
    hand = shipped_hand()
    features(hand, scene.shape, windows_of([scene]), *forward_kinematics(hand, np.zeros((1, hand.angle_count))))
    track, angles = PoseBuffer(), np.zeros(hand.angle_count)
    for t_s in (0.0, 0.1):
        track.add(t_s, still[0])
    sample([track], np.linspace(-0.5, 0.5, 21), 0.0, 0.1, damped_velocity)
    keep_angles(angles, hand.limits.copy(), angles, 1.0, np.empty_like(angles))
    pose_in_world(hand, ["right"], angles[None], still[:1], 1.0)


class Precompiler:
    """The second process, if one is needed."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def idle(self) -> bool:
        """Whether none was needed so far."""
        return self._process is None

    def start(self) -> None:
        """Let it begin, unless everything is in the cache."""
        if not cached(SENSING):
            quiet = subprocess.DEVNULL
            command = [sys.executable, "-m", "manipnet.runtime.precompile"]
            self._process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet)

    def wait(self) -> None:
        """Until it is done. Where it failed, whoever needs a kernel compiles it."""
        if self._process is not None:
            self._process.wait()


if __name__ == "__main__":
    compile_aside()
