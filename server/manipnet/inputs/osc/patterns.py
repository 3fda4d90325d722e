"""The OSC addresses that are understood, and the meaning of their arguments, as one table.

In an address, `<body>` stands for a streaming id or a name; `<skeleton>` and `<bone>` together name the body
"skeleton:bone". Each argument is one of these words:

    body, skeleton, bone     which body it is about
    x y z                    a position
    qx qy qz qw              a quaternion
    rx ry rz                 Euler angles
    tracked                  whether the body is tracked: 0, 1, or another number for true
    number, ms, s            a frame's number, its time in milliseconds, its time in seconds
    smpte, subframe          a time code as four bytes in an integer
    name                     the name of the body
    -                        an argument that is not used
    =number, =word           a number or a word that must be there, by which a message is recognised
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

from manipnet.inputs.osc.space import AXES, Space

POSITION: Final = ("x", "y", "z")
QUATERNION: Final = ("qx", "qy", "qz", "qw")
EULER: Final = ("rx", "ry", "rz")
KEYS: Final = ("body", "skeleton", "bone")
COMPONENTS: Final = (*POSITION, *QUATERNION, *EULER)
FRAME: Final = ("number", "ms", "s", "smpte", "subframe")

OURS: Final = Space()
UNITY: Final = Space(AXES["unity"])


@dataclass(frozen=True)
class Pattern:
    """An address and its arguments. `space` says in which frame the pose is given."""

    address: str
    arguments: str
    space: Space = OURS
    field: str = ""
    """The field that a message states, if its arguments do not say which."""
    body: str = ""
    """The body, if neither the address nor the arguments say which."""
    alias: str = ""
    """Another name of that body, which is used if the rig has it."""
    is_bridge: bool = False
    """Whether the sender is a NatNet bridge, whose axes are an option of the server."""

    @property
    def words(self) -> tuple[str, ...]:
        """The words of the arguments."""
        return tuple(self.arguments.split())

    def regex(self) -> re.Pattern[str]:
        """Matches addresses, with the groups `body`, `skeleton` and `bone`."""
        text = re.escape(self.address)
        for key in KEYS:
            text = text.replace(re.escape(f"<{key}>"), f"(?P<{key}>.*)")
        return re.compile(text)


def _bridge(address: str, arguments: str, field: str = "") -> Pattern:
    return Pattern(address, arguments, OURS, field, is_bridge=True)


_POSE: Final = "x y z qx qy qz qw"

PATTERNS: Final[tuple[Pattern, ...]] = (
    # NatNet bridges
    _bridge("/rigidbody/<body>/transformation", _POSE),
    _bridge("/rigidbody/<body>/position", "x y z"),
    _bridge("/rigidbody/<body>/quat", "qx qy qz qw"),
    _bridge("/rigidbody/<body>/tracked", "tracked"),
    _bridge("/rigidbody", f"body =transformation {_POSE}"),
    _bridge("/rigidbody", "body =position x y z"),
    _bridge("/rigidbody", "body =quat qx qy qz qw"),
    _bridge("/rigidbody", "body =tracked tracked"),
    _bridge("/rb", "body =0 tracked"),
    _bridge("/rb", f"body =2 - {_POSE}"),
    _bridge("/skeleton/<skeleton>/bone/<bone>/transformation", _POSE),
    _bridge("/skeleton/<skeleton>/bone/<bone>/position", "x y z"),
    _bridge("/skeleton/<skeleton>/bone/<bone>/quat", "qx qy qz qw"),
    _bridge("/skeleton/bone", "skeleton bone =position x y z"),
    _bridge("/skeleton/bone", "skeleton bone =quat qx qy qz qw"),
    _bridge("/skel", f"skeleton bone =2 - {_POSE}"),
    _bridge("/skel", f"skeleton bone - {_POSE}"),
    *(
        Pattern(f"{root}{address}", arguments, field=field)
        for root in ("", "/motive")
        for address, arguments, field in (
            ("/rigidbody/id", "name body", "name"),
            ("/skeleton/id", "name skeleton", "skeleton"),
            ("/skeleton/id/bone", "skeleton bone name", "name"),
        )
    ),
    Pattern("/frame/start", "number", field="start"),
    Pattern("/frame/end", "number", field="end"),
    Pattern("/frame/timestamp", "ms"),
    Pattern("/frame/timecode", "smpte subframe"),
    Pattern("/f/s", "number", field="start"),
    Pattern("/f/e", "number", field="end"),
    Pattern("/f/t", "ms"),
    # VMC
    *(Pattern(f"/VMC/Ext/{device}/Pos", f"body {_POSE}", UNITY) for device in ("Tra", "Con", "Hmd")),
    *(Pattern(f"/VMC/Ext/{device}/Pos/Local", f"body {_POSE}", UNITY, "local") for device in ("Tra", "Con", "Hmd")),
    Pattern("/VMC/Ext/T", "s"),
    # VRChat
    Pattern("/tracking/trackers/<body>/position", "x y z", UNITY),
    Pattern("/tracking/trackers/<body>/rotation", "rx ry rz", UNITY),
    Pattern("/tracking/vrsystem/leftwrist/pose", "x y z rx ry rz", UNITY, body="leftwrist", alias="left_wrist"),
    Pattern("/tracking/vrsystem/rightwrist/pose", "x y z rx ry rz", UNITY, body="rightwrist", alias="right_wrist"),
    Pattern("/tracking/vrsystem/<body>/pose", "x y z rx ry rz", UNITY),
    # Virtual Motion Tracker, whose mode is 0 for a tracker that is switched off
    Pattern("/VMT/Room/Unity", f"body tracked - {_POSE}", UNITY),
    Pattern("/VMT/Raw/Unity", f"body tracked - {_POSE}", UNITY),
    Pattern("/VMT/Room/UEuler", "body tracked - x y z rx ry rz", UNITY),
    Pattern("/VMT/Raw/UEuler", "body tracked - x y z rx ry rz", UNITY),
    Pattern("/VMT/Room/Driver", f"body tracked - {_POSE}"),
    Pattern("/VMT/Raw/Driver", f"body tracked - {_POSE}"),
)
"""Every address that is understood without a declaration."""

WITHOUT_BODY: Final = (
    "/VMC/Ext/OK",
    "/VMC/Ext/Root/Pos",
    "/VMC/Ext/Bone/Pos",
    "/VMC/Ext/Blend/Val",
    "/VMC/Ext/Blend/Apply",
    "/VMC/Ext/Cam",
    "/VMC/Ext/Rcv",
    "/VMC/Ext/Light",
)
"""Addresses that are known to hold nothing about tracked bodies."""


def with_axes(patterns: Iterable[Pattern], axes: str) -> list[Pattern]:
    """The patterns, with the given axes for those of the NatNet bridges."""
    space = Space(axes)
    return [replace(each, space=space) if each.is_bridge else each for each in patterns]
