"""Synthesise offline: the fingers of a right hand that reaches for a mug, without a server, through the public API.

    python examples/synthesise_offline.py [mug]

At every tick, 60 times a second, the hand sees half a second of its wrist's and the object's motion to either side of
the present (`HandScene`), and the synthesizer steps it from its last state to its next pose. The argument is an object
of the library or a mesh file. For recorded takes, `manipnet synthesize` does all of this.
"""

import sys

import numpy as np

from manipnet import HandScene, Synthesizer, load_bundle, load_shape
from manipnet.synthesis.model.layout import WINDOW_OFFSETS_S

TICK_S = 1.0 / 60.0
REACH_S = 1.0
FAR, NEAR = np.array([-0.45, 0.0, 0.058]), np.array([-0.125, -0.01, 0.058])
"""Where the wrist begins and ends, from the mug's centre: with the fingers along +x, the palm faces it."""
UNTURNED = np.array([0.0, 0.0, 0.0, 1.0])


def main(mesh: str = "mug") -> None:
    """Print where the thumb and the fingertips are as the hand closes."""
    shape = load_shape(mesh)
    synthesizer = Synthesizer(load_bundle())
    state = synthesizer.rest_state()
    for tick in range(90):
        instants = tick * TICK_S + WINDOW_OFFSETS_S
        scene = HandScene("right", wrist_at(instants), None, mug_at(instants), shape)
        (step,) = synthesizer.step([scene], [state])
        state = step.state
        if tick % 15 == 0:
            tips = step.positions[17:]  # (5, 3) from the thumb to the little finger, metres, in the wrist frame
            print(f"{tick * TICK_S:.2f} s", *(f"({x:+.3f} {y:+.3f} {z:+.3f})" for x, y, z in tips))


def wrist_at(time_s: np.ndarray) -> np.ndarray:
    """The wrist's poses `(N, 7)` at `time_s (N,)`: it eases from far to near, and stays."""
    gone = np.clip(time_s / REACH_S, 0.0, 1.0)[:, None]
    return poses(FAR + (3.0 - 2.0 * gone) * gone**2 * (NEAR - FAR))


def mug_at(time_s: np.ndarray) -> np.ndarray:
    """The mug's poses `(N, 7)`: it stands still at the origin."""
    return poses(np.zeros((len(time_s), 3)))


def poses(positions: np.ndarray) -> np.ndarray:
    """Poses `(N, 7)` without a turn."""
    return np.concatenate([positions, np.broadcast_to(UNTURNED, (len(positions), 4))], axis=1)


if __name__ == "__main__":
    main(*sys.argv[1:])
