"""Compiles the sensing kernels in a child process at the first start of an installation.

The child also compiles what builds shapes and some smaller kernels, while the server imports its libraries and compiles
inverse kinematics. The server then finds the child's work in the cache.
"""

from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Final

from manipnet.jit import cached, collection_paused, seal_cache
from manipnet.runtime.child_process import ChildProcess

SENSING: Final = "_all_but_readings"
"""The kernel of `synthesis.model.features` that takes longest to compile."""


def compile_aside() -> None:
    """Compile all kernels of a start and of a tick except the solver's, by using each of them."""
    import numpy as np

    from manipnet.runtime.warm_up import carry_a_hand
    from manipnet.synthesis.hand.kinematics import forward_kinematics
    from manipnet.synthesis.hand.limits import keep_angles
    from manipnet.synthesis.hand.openxr import pose_in_world
    from manipnet.synthesis.model.features import features
    from manipnet.synthesis.model.shipped import shipped_hand
    from manipnet.synthesis.objects.distance_field import build_field
    from manipnet.synthesis.objects.shape import load_shape
    from manipnet.synthesis.synthesizer import HandScene, windows_of
    from manipnet.tracking.forecast import damped_velocity
    from manipnet.tracking.pose_buffer import PoseBuffer, sample
    from manipnet.tracking.smoothing import Smoothing

    still = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (21, 1))
    scene = HandScene("right", still, still, still, load_shape("cube"))
    build_field(scene.shape.bvh)
    hand = shipped_hand()
    features(hand, scene.shape, windows_of([scene]), *forward_kinematics(hand, np.zeros((1, hand.angle_count))))
    track, angles = PoseBuffer(), np.zeros(hand.angle_count)
    for t_s in (0.0, 0.1):
        track.add(t_s, still[0])
    smoothing = Smoothing(share=1.0, noise=1.0, half_width_s=0.2)
    sample([track], np.linspace(-0.5, 0.5, 21), 0.0, 0.1, damped_velocity, smoothing)
    keep_angles(angles, hand.limits.copy(), angles, 1.0, np.empty_like(angles))
    pose_in_world(hand, ["right"], angles[None], still[:1], 1.0)
    carry_a_hand(hand, scene.shape)


class Precompiler:
    """Runs the child process if anything is missing in the cache."""

    def __init__(self) -> None:
        self._child: ChildProcess | None = None

    @property
    def idle(self) -> bool:
        """Whether no child process was needed."""
        return self._child is None

    def start(self) -> None:
        """Begin to compile, unless everything is in the cache."""
        if not cached(SENSING):
            self._child = ChildProcess("precompile", _compile)

    def wait(self) -> None:
        """Wait for the end of the child. If it failed, the server compiles what it needs itself."""
        if self._child is not None:
            self._child.close()


def _compile(_: Connection) -> None:
    with suppress(Exception), collection_paused():  # the server meets the same error and reports it
        compile_aside()
        seal_cache()
