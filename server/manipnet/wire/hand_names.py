"""The hand as messages carry it: names, order and counts of its joints, bones and angles.

These are facts of the wire, which every client relies on: `hello` lists the names, and the records of `wire.hands` have
room for exactly that many. A hand with other joints or angles cannot be published; `misfit` says why.
"""

from collections.abc import Sequence
from typing import Final

BONE_NAMES: Final = (
    "WRIST",
    *("THUMB_CMC_FE", "THUMB_CMC_AA", "THUMB_MCP_FE", "THUMB_IP_FE"),
    *("INDEX_MCP", "INDEX_PIP_FE", "INDEX_DIP_FE"),
    *("MIDDLE_MCP", "MIDDLE_PIP_FE", "MIDDLE_DIP_FE"),
    *("RING_MCP", "RING_PIP_FE", "RING_DIP_FE"),
    *("PINKY_MCP", "PINKY_PIP_FE", "PINKY_DIP_FE"),
)
"""The 17 bones, each named after the joint it starts at."""

JOINT_NAMES: Final = (*BONE_NAMES, "THUMB_TIP", "INDEX_TIP", "MIDDLE_TIP", "RING_TIP", "PINKY_TIP")
"""The 22 joints: the bones' and the five fingertips."""

ANGLE_NAMES: Final = (
    *("THUMB_CMC_FE", "THUMB_CMC_AA", "THUMB_MCP_FE", "THUMB_IP_FE"),
    *("INDEX_MCP_FE", "INDEX_MCP_AA", "INDEX_PIP_FE", "INDEX_DIP_FE"),
    *("MIDDLE_MCP_FE", "MIDDLE_MCP_AA", "MIDDLE_PIP_FE", "MIDDLE_DIP_FE"),
    *("RING_MCP_FE", "RING_MCP_AA", "RING_PIP_FE", "RING_DIP_FE"),
    *("PINKY_MCP_FE", "PINKY_MCP_AA", "PINKY_PIP_FE", "PINKY_DIP_FE"),
)
"""The 20 angles: flexion and extension (FE), abduction and adduction (AA)."""

_FINGERS = ("index", "middle", "ring", "little")

OPENXR_JOINT_NAMES: Final = (
    "palm",
    "wrist",
    *(f"thumb_{part}" for part in ("metacarpal", "proximal", "distal", "tip")),
    *(f"{f}_{part}" for f in _FINGERS for part in ("metacarpal", "proximal", "intermediate", "distal", "tip")),
)
"""The 26 joints of OpenXR's XR_EXT_hand_tracking, in its order."""

OPENXR_PARENTS: Final = (1, -1, 1, 2, 3, 4, *(p for f in range(4) for p in (1, *range(6 + 5 * f, 10 + 5 * f))))
"""The parent of each OpenXR joint. Everything hangs on the wrist, whose own parent is -1."""


def webxr_name(joint: str) -> str:
    """An OpenXR joint's name in WebXR's spelling. WebXR itself has no palm."""
    finger, _, part = joint.partition("_")
    if not part:
        return joint
    if finger != "thumb":
        finger = f"{finger.replace('little', 'pinky')}-finger"
    return f"{finger}-{part}" if part in ("metacarpal", "tip") else f"{finger}-phalanx-{part}"


WEBXR_JOINT_NAMES: Final = tuple(webxr_name(name) for name in OPENXR_JOINT_NAMES[1:])
"""The 25 joints of WebXR: OpenXR's from the wrist on, in the same order."""


def misfit(joint_names: Sequence[str], angle_names: Sequence[str]) -> str:
    """Why messages cannot carry a hand with these joints and angles; empty if they can."""
    for what, found, expected in (("joint", joint_names, JOINT_NAMES), ("angle", angle_names, ANGLE_NAMES)):
        if tuple(found) == expected:
            continue
        if len(found) != len(expected):
            return f"it has {len(found)} {what}s, messages carry {len(expected)}: {', '.join(expected)}"
        k = next(k for k, (ours, theirs) in enumerate(zip(found, expected, strict=True)) if ours != theirs)
        return f"its {what} {k} is {found[k]}, messages carry {expected[k]} there"
    return ""
