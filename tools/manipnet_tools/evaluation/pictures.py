"""Pictures of one frame: a hand's capsules on the object."""

import numpy as np

from manipnet import geometry
from manipnet.geometry import Array, Side
from manipnet_tools.evaluation import metrics
from manipnet_tools.evaluation.cases import Case
from manipnet_tools.rendering import CERAMIC, SKIN_RIGHT, Camera, Image, PaintedMesh, beads, render, rods

PRESSED = (0.78, 0.16, 0.12)
PICTURE = (420, 420)


def grasp_picture(case: Case, side: Side, positions: Array, frame: int, mark: bool = True) -> Image:
    """Joints `(J, 3)` in the canonical wrist frame, seen from the thumb side; `mark` paints touching capsules red."""
    T_wrist_object = geometry.compose(
        geometry.invert(case.ticks.bodies[f"{side}_wrist"].poses[frame]), case.T_world_object[frame]
    )
    vertices = geometry.transform(T_wrist_object, case.shape.mesh.vertices)
    faces = case.shape.mesh.faces.astype(np.int64)
    if side == "left":
        vertices, faces = geometry.mirror_points(vertices), faces[:, ::-1]
    touches = case[frame : frame + 1].gaps_of(side, positions[None]).gap[0] < metrics.CONTACT_M
    meshes = [PaintedMesh(vertices, faces, CERAMIC)]
    for capsule, (start, end) in enumerate(case.hand.capsules):
        radius, color = float(case.hand.radii[capsule]), PRESSED if mark and touches[capsule] else SKIN_RIGHT
        ends = positions[[start, end]]
        meshes += [rods(ends[:1], ends[1:], radius, color), beads(ends, radius, color)]
    view = Camera.orbit(np.array([0.1, 0.0, -0.03]), 0.5, azimuth=np.radians(160), elevation=np.radians(25))
    return render(meshes, view, PICTURE)
