"""The OSC bundle of one hand. Only its numbers change from tick to tick.

python-osc takes 0.3 ms to build such a bundle, which for two hands would be a thirtieth of a tick. So it builds a
template once, and the numbers are written into copies of it, which takes 0.01 ms.
"""

from collections.abc import Sequence

import numpy as np

from manipnet.geometry import Array
from manipnet.net.osc import osc_bundle, osc_message

_BUNDLE_HEADER_BYTES, _SIZE_BYTES = 16, 4
_POSE_BYTES = 28


class HandBundle:
    """The bundle with the state of the sender, its time and the poses of some bones, by their names.

    It ends with the message that applies blend shapes. There are none, but some receivers show nothing before it.
    """

    def __init__(self, bones: Sequence[str]) -> None:
        messages = [
            osc_message("/VMC/Ext/OK", "i", 1),
            osc_message("/VMC/Ext/T", "f", 0.0),
            *(osc_message("/VMC/Ext/Bone/Pos", "sfffffff", bone, *(0.0,) * 7) for bone in bones),
            osc_message("/VMC/Ext/Blend/Apply", ""),
        ]
        self._template = np.frombuffer(osc_bundle(messages), np.uint8)
        ends = _BUNDLE_HEADER_BYTES + np.cumsum([_SIZE_BYTES + message.size for message in messages])
        self._time = slice(ends[1] - 4, ends[1])
        self._poses = ends[2:-1, None] - _POSE_BYTES + np.arange(_POSE_BYTES)

    def filled(self, t_s: float, poses: Array) -> bytes:
        """The bundle at the sender's time `t_s` with the bones' poses `(N, 7)`, position then quaternion."""
        data = self._template.copy()
        data[self._time] = np.array([t_s], ">f4").view(np.uint8)
        data[self._poses] = np.ascontiguousarray(poses, ">f4").view(np.uint8)
        return data.tobytes()
