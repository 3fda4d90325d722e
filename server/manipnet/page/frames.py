"""What the server sends to its live page: one tick of one actor, and the shapes in it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from manipnet.geometry import Array
from manipnet.wire import HandsMessage, Side


@dataclass(frozen=True, slots=True, eq=False)
class PropView:
    """A prop: the name of its body, the name and hash of its shape, its scale, and its offset on the body."""

    name: str
    object: str
    content_hash: str
    scale: float
    offset: Array
    """T_body_prop `(7,)`."""


@dataclass(frozen=True, slots=True, eq=False)
class HandView:
    """What the network predicted for one hand, in its own wrist frame, as a right hand of the model's size."""

    prop: str
    distances: Array
    """`(22,)` joint to surface, as predicted."""
    raw_positions: Array
    """`(22, 3)` before inverse kinematics."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One tick of one actor. `windows` are the trajectories `(21, 7)` around it, by body."""

    message: HandsMessage
    props: tuple[PropView, ...]
    windows: Mapping[str, Array]
    hands: Mapping[Side, HandView]


@dataclass(frozen=True, slots=True, eq=False)
class ShapeView:
    """A closed mesh: `vertices (V, 3)` metres, `faces (F, 3)`."""

    name: str
    content_hash: str
    vertices: Array
    faces: np.ndarray
