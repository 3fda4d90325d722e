"""The hand: 17 bones and 5 tips, driven by 20 angles.

Everything here is a **right** hand in its wrist frame: +x to the fingers, +y to the thumb side, palm facing -z,
metres. A left hand is its exact mirror image (`geometry.mirror_*`). Angle zero is the flat hand: fingers straight along
+x; the two carpal thumb angles are zero in the middle of their range. Flexion toward the palm is positive, abduction
toward the thumb is positive. Offsets, axes and ranges were fitted to the subject of the ManipNet dataset.
"""

from typing import Final

import numpy as np

JOINT_NAMES: Final = (
    "WRIST",
    *("THUMB_CMC_FE", "THUMB_CMC_AA", "THUMB_MCP_FE", "THUMB_IP_FE"),
    *("INDEX_MCP", "INDEX_PIP_FE", "INDEX_DIP_FE"),
    *("MIDDLE_MCP", "MIDDLE_PIP_FE", "MIDDLE_DIP_FE"),
    *("RING_MCP", "RING_PIP_FE", "RING_DIP_FE"),
    *("PINKY_MCP", "PINKY_PIP_FE", "PINKY_DIP_FE"),
    *("THUMB_TIP", "INDEX_TIP", "MIDDLE_TIP", "RING_TIP", "PINKY_TIP"),
)
JOINT_COUNT: Final = 22
BONE_COUNT: Final = 17
DOF_COUNT: Final = 20

PARENTS: Final = np.array([-1, 0, 1, 2, 3, 0, 5, 6, 0, 8, 9, 0, 11, 12, 0, 14, 15, 4, 7, 10, 13, 16])

FINGER_JOINTS: Final = ((1, 2, 3, 4, 17), (5, 6, 7, 18), (8, 9, 10, 19), (11, 12, 13, 20), (14, 15, 16, 21))
"""Joints of thumb, index, middle, ring, pinky, from the root to the tip."""

OFFSETS_M: Final = np.array(
    [
        [0.0, 0.0, 0.0],
        [0.0225143, 0.0117753, -0.0062308],
        [0.0212856, -0.0150507, 0.0098851],
        [-0.0322503, -0.0167445, -0.0031436],
        [0.0295233, -0.0236404, 0.0025845],
        [0.1076913, 0.0264198, -0.0014768],
        [0.0425053, 0.0013289, 0.0013619],
        [0.0271505, -0.0024898, 0.0000550],
        [0.1072991, 0.0019362, 0.0038780],
        [0.0480704, 0.0002618, 0.0028696],
        [0.0307486, -0.0031129, -0.0000643],
        [0.0994992, -0.0195930, -0.0005938],
        [0.0436995, 0.0003792, 0.0019994],
        [0.0295558, -0.0038341, -0.0006642],
        [0.0873858, -0.0393246, -0.0086282],
        [0.0343972, -0.0016492, 0.0013445],
        [0.0224713, -0.0036309, -0.0010265],
        [0.02138, -0.01741, -0.00155],
        [0.02498, 0.00248, 0.00086],
        [0.02774, 0.00335, -0.00237],
        [0.02729, -0.00034, -0.00179],
        [0.02458, -0.00068, -0.00140],
    ]
)
"""Offset of each joint in its parent bone's frame, `(22, 3)`."""

_REST_QUATS = np.array(
    [
        [0.0, 0.0, 0.0, 1.0],
        [0.332704, 0.388948, 0.493294, 0.703341],
        [-0.051780, 0.841104, 0.277563, 0.461326],
        [-0.069944, -0.758031, -0.574005, 0.301688],
        [-0.073826, 0.039459, -0.000226, 0.996490],
        [0.999287, 0.016100, 0.015526, 0.030417],
        [-0.689103, 0.004652, 0.037677, 0.723668],
        [0.016519, -0.016406, -0.095269, 0.995179],
        [-0.999545, -0.002610, -0.029818, 0.003671],
        [-0.699426, 0.008211, 0.020923, 0.714352],
        [0.044034, -0.047591, -0.112254, 0.991562],
        [-0.998818, -0.003355, -0.023022, 0.042677],
        [-0.683534, 0.014126, 0.044241, 0.728440],
        [0.004803, 0.002023, -0.058331, 0.998284],
        [-0.993523, 0.025930, -0.016780, 0.109349],
        [-0.680402, 0.008742, 0.071837, 0.729257],
        [0.003854, 0.048684, -0.066144, 0.996614],
    ]
)
REST_QUATS: Final = _REST_QUATS / np.linalg.norm(_REST_QUATS, axis=1, keepdims=True)
"""Local rotation of each bone when its angles are zero, `(17, 4)` xyzw."""

_DOFS = (
    # name, joint, axis in the parent bone's frame (abduction: as the flexion before has turned it), limits in degrees
    ("THUMB_CMC_FE", 1, (-0.875368, 0.084277, -0.476054), (-31, 39)),
    ("THUMB_CMC_AA", 2, (-0.747302, -0.514693, 0.420274), (-38, 36)),
    ("THUMB_MCP_FE", 3, (0.377081, -0.912429, 0.159005), (-22, 50)),
    ("THUMB_IP_FE", 4, (-0.078674, -0.147116, -0.985985), (-37, 65)),
    ("INDEX_MCP_FE", 5, (0.003857, 0.998173, -0.060290), (-24, 64)),
    ("INDEX_MCP_AA", 5, (-0.031924, 0.059964, 0.997690), (-30, 18)),
    ("INDEX_PIP_FE", 6, (0.045194, -0.997715, -0.050231), (-12, 120)),
    ("INDEX_DIP_FE", 7, (0.035802, 0.029753, -0.998916), (-19, 80)),
    ("MIDDLE_MCP_FE", 8, (0.098135, 0.995085, 0.013234), (-23, 84)),
    ("MIDDLE_MCP_AA", 8, (-0.059580, -0.007254, 0.998197), (-35, 15)),
    ("MIDDLE_PIP_FE", 9, (0.017538, -0.999616, -0.021472), (-12, 117)),
    ("MIDDLE_DIP_FE", 10, (0.104265, 0.076640, -0.991592), (-25, 81)),
    ("RING_MCP_FE", 11, (0.240643, 0.966055, 0.093959), (-23, 91)),
    ("RING_MCP_AA", 11, (-0.045532, -0.085254, 0.995318), (-38, 8)),
    ("RING_PIP_FE", 12, (0.039901, -0.997077, -0.065164), (-12, 119)),
    ("RING_DIP_FE", 13, (-0.003478, 0.009825, -0.999946), (-19, 76)),
    ("PINKY_MCP_FE", 14, (0.311700, 0.924922, 0.217629), (-35, 101)),
    ("PINKY_MCP_AA", 14, (-0.039042, -0.216265, 0.975554), (-38, 14)),
    ("PINKY_PIP_FE", 15, (0.085006, -0.993632, -0.073953), (-12, 117)),
    ("PINKY_DIP_FE", 16, (-0.096528, 0.014122, -0.995230), (-18, 88)),
)

DOF_NAMES: Final = tuple(dof[0] for dof in _DOFS)
DOF_JOINTS: Final = np.array([dof[1] for dof in _DOFS])
"""The bone each angle turns, `(20,)`."""

_DOF_AXES = np.array([dof[2] for dof in _DOFS])
DOF_AXES: Final = _DOF_AXES / np.linalg.norm(_DOF_AXES, axis=1, keepdims=True)
"""Unit hinge axes in the parent bone's frame at angle zero, `(20, 3)`."""

DOF_LIMITS_RAD: Final = np.radians(np.array([dof[3] for dof in _DOFS], dtype=np.float64))
"""Lower and upper limit of each angle, `(20, 2)`: 0.5 to 99.5 percentile of the captured hand, widened by 7 degrees."""

CAPSULE_JOINTS: Final = np.array(
    [
        *((0, 5), (0, 8), (0, 11), (0, 14)),
        *((2, 3), (3, 4), (4, 17)),
        *((5, 6), (6, 7), (7, 18)),
        *((8, 9), (9, 10), (10, 19)),
        *((11, 12), (12, 13), (13, 20)),
        *((14, 15), (15, 16), (16, 21)),
    ]
)
"""Start and end joint of the 19 capsules: 4 palm (wrist to MCP), then 3 per finger from thumb to pinky."""

CAPSULE_RADII_M: Final = 1e-3 * np.array(
    [19, 22, 20, 20, 20, 11.6, 11.0, 11.7, 9.1, 8.6, 11.9, 9.7, 9.2, 11.5, 9.0, 8.6, 9.3, 7.7, 7.3]
)
