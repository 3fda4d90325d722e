"""The solver is chosen on the command line or in the rig file, and the hands follow it."""

from pathlib import Path

import numpy as np
from live_server import Stage, scene, serving

from manipnet.synthesis.objects.library import LIBRARY_FOLDER


def angles_of(stage: Stage) -> np.ndarray:
    """The angles of both hands in a second of a performance, `(60, 2, 20)`."""
    messages = stage.perform(1.0, scene)[-60:]
    return np.array([[hand.angles for hand in message.hands.values()] for message in messages])


def test_another_solver_makes_other_angles(stage: Stage, tiny_bundle: Path, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(
        f"""
[bodies]
left_wrist = "left_wrist"
right_wrist = "right_wrist"
[[objects]]
body = "Box"
mesh = {str(LIBRARY_FOLDER / "cube.ply")!r}
[server]
solver = "none"
"""
    )
    angles = {"wrench": angles_of(stage)}
    for solver, options in (("ccd", ("--solver", "ccd")), ("none", ())):
        with serving("--rig", str(rig), "--model", str(tiny_bundle), *options) as server:
            another = Stage(server)
            named = {another.server.ask({"op": op})["solver"] for op in ("hello", "status")}
            assert named == {solver}
            angles[solver] = angles_of(another)
            another.close()
    for one, other in (("ccd", "wrench"), ("none", "ccd"), ("none", "wrench")):
        assert np.abs(angles[one] - angles[other]).max() > np.radians(1.0), f"{one} and {other} make the same hands"
