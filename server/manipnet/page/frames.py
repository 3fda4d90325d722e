"""What the server sends to its live page: one tick of one actor, and the shapes of the props in it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from manipnet.geometry import Array
from manipnet.wire import HandsMessage, Side


@dataclass(frozen=True, slots=True, eq=False)
class PropView:
    """A prop: the name of its body, the name and hash of its shape, its scale, and its place on the body."""

    name: str
    object: str
    content_hash: str
    scale: float
    offset: Array
    """T_body_prop `(7,)`."""


@dataclass(frozen=True, slots=True, eq=False)
class HandView:
    """The network's output for one hand, in its wrist frame, as a right hand of the model's size."""

    prop: str
    distances: Array
    """`(J,)` predicted distances of the joints to the surface."""
    raw_positions: Array
    """`(J, 3)` joint positions before inverse kinematics."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One tick of one actor. `windows` are the trajectories `(21, 7)` around the tick, by body."""

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
