"""Compiles the sensing kernels in a child process at the first start of an installation.

The child also compiles what builds shapes and some smaller kernels, while the server imports its libraries and compiles
inverse kinematics. The server then finds the child's work in the cache.

`python -m manipnet.runtime.precompile` compiles everything for whoever starts this installation first, for a container
perhaps; with `--into FOLDER` it does so for a wheel that is still to be built.
"""

import argparse
import sys
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

from manipnet.common.shipped_folder import FOLDER
from manipnet.jit import cached, collection_paused, seal_cache, ship_kernels
from manipnet.runtime.child_process import ChildProcess

SENSING: Final = "_all_but_readings"
"""The kernel of `synthesis.model.features` that takes longest to compile."""


def compile_aside() -> None:
    """Compile all kernels of a start and of a tick except the solver's, by using each of them."""
    import numpy as np

    from manipnet.actors.soundness import are_sound
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
    from manipnet.tracking.outlier_gate import OutlierGate
    from manipnet.tracking.pose_buffer import PoseBuffer, sample
    from manipnet.tracking.smoothing import Smoothing
    from manipnet.wire.bodies import BodyFrame, BodySample

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
    are_sound(angles, np.zeros((1, 4), np.intp), 1.0, 1.0)
    OutlierGate().check(
        BodyFrame(0.0, None, (BodySample(1, None, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), True),), 0.0, "")
    )
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


def main(arguments: list[str] | None = None) -> int:
    """Compile the kernels, so that no first start has to. They fit this version of Python and this kind of computer."""
    own = Path(__file__).parents[1] / FOLDER
    parser = argparse.ArgumentParser(prog="python -m manipnet.runtime.precompile", description=main.__doc__)
    parser.add_argument("--into", type=Path, default=own, metavar="FOLDER", help="default: this installation's kernels")
    into: Path = parser.parse_args(arguments).into
    from manipnet.runtime.warm_up import pose_a_hand
    from manipnet.synthesis.model.bundle import load_bundle

    with collection_paused():
        compile_aside()
        pose_a_hand(load_bundle())
    try:
        count = ship_kernels(into)
    except (OSError, ValueError) as error:
        print(f"the kernels cannot be written into {into}: {error}", file=sys.stderr)
        return 1
    print(f"wrote {count} files of compiled kernels into {into}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
