"""The streamed bodies of one actor: which role each of them plays, and where on the body the role's frame sits.

A role is `left_wrist`, `right_wrist` or the name of a prop.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from manipnet.config.settings import ActorConfig, BodyKey
from manipnet.geometry import Array, compose
from manipnet.wire.bodies import BodySample

NO_OFFSET: Final = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
"""The offset of a wrist or prop whose frame is the frame of its body."""


class BodyRoles:
    """Finds an actor's wrists and props in the frames of a stream."""

    def __init__(self, config: ActorConfig) -> None:
        bodies = config.wrists | {prop.name: prop.body for prop in config.objects}
        self._roles = {key: role for role, body in bodies.items() for key in _same_body(body.key)}
        self._offsets = {role: body.offset for role, body in bodies.items() if body.offset is not None}

    def names(self) -> list[str]:
        """Every role that a body plays, wrists first."""
        return list(dict.fromkeys(self._roles.values()))

    def keys(self) -> dict[str, BodyKey]:
        """The body of each role, by id or name, as the rig or a request gave it."""
        first: dict[str, BodyKey] = {}
        for key, role in self._roles.items():
            first.setdefault(role, key)
        return first

    def role(self, body: BodyKey) -> str | None:
        """The role of a body, which is given by its key in the stream or by the role itself; None if it has none."""
        return self._roles.get(body) or (str(body) if body in self._roles.values() else None)

    def assign(self, body: BodyKey) -> str:
        """The role of a body; a body without one plays the prop of its own name from now on."""
        role = self.role(body)
        if role is None:
            role = str(body)
            self._roles |= dict.fromkeys(_same_body(body), role)
        return role

    def forget(self, role: str) -> None:
        """Let the body of a role be unknown again, and forget the role's offset."""
        self._roles = {key: other for key, other in self._roles.items() if other != role}
        self._offsets.pop(role, None)

    def offset(self, role: str) -> Array:
        """The frame of a wrist or prop in the frame of its body: T_body_role `(7,)`."""
        return self._offsets.get(role, NO_OFFSET)

    def place(self, role: str, offset: Array) -> None:
        """Change the offset T_body_role `(7,)`."""
        self._offsets[role] = offset

    def poses(self, bodies: Mapping[BodyKey, BodySample]) -> dict[str, Array | None]:
        """World poses `(7,)` by role of the `bodies` of a frame that have one, from `BodyFrame.by_key`; None for a body
        that is not tracked."""
        poses: dict[str, Array | None] = {}
        for key, role in self._roles.items():
            sample = bodies.get(key)
            if sample is None or (key == sample.name and sample.id in self._roles and sample.id is not None):
                continue  # it has another role by its id
            poses[role] = _pose(sample, self._offsets.get(role)) if sample.tracked else None
        return poses


def _same_body(key: BodyKey) -> tuple[BodyKey, ...]:
    """All keys of a body: some bridges send its streaming id, a number, as a name."""
    if isinstance(key, int):
        return key, str(key)
    return (key, int(key)) if key.isdecimal() else (key,)


def _pose(sample: BodySample, offset: Array | None) -> Array:
    pose = np.array(sample.p + sample.q)
    return pose if offset is None else compose(pose, offset)
