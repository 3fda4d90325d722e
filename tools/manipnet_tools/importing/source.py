"""What an import reads: takes with the joints of hands, the poses of objects, and where all that comes from."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from manipnet.geometry import Array, Side
from manipnet.synthesis.objects.mesh import ClosedMesh

FINGERS: Final = ("thumb", "index", "middle", "ring", "little")
JOINT_COUNT: Final = 21
"""The wrist, then of each finger from the thumb on four joints: three from its root outward, and its tip.

The thumb's are those of its metacarpal (CMC), proximal (MCP) and distal (IP) bones, the others' MCP, PIP and DIP.
"""

PALM: Final = (0, 5, 9, 13, 17)
"""The joints of the palm: the wrist and the knuckles of the four fingers."""


class ImportingError(ValueError):
    """Something cannot be imported; the text names the file, the reason and the remedy."""


@dataclass(frozen=True)
class Origin:
    """Where takes come from, and on what terms."""

    name: str
    licence: str
    attribution: str
    url: str = ""


@dataclass(frozen=True, eq=False)
class SourceTake:
    """T frames of a take, right-handed, in metres. A missing joint or pose is NaN."""

    name: str
    rate_hz: float
    hands: dict[Side, Array]
    """Joints `(T, 21, 3)` in the world."""
    objects: dict[str, Array]
    """Poses `(T, 7)` in the world."""


@dataclass(frozen=True)
class SourceSet:
    """A set of takes, which are read one by one."""

    origin: Origin
    takes: tuple[str, ...]
    read: Callable[[str], SourceTake]
    """Reads a take by its name. Raises `ImportingError`."""
    mesh: Callable[[str], ClosedMesh]
    """Reads the mesh of an object by its name. Raises `ImportingError` and `MeshError`."""
