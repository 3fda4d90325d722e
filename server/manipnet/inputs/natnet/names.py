"""Which names the ids in a stream have, and when to ask the server for its definitions again."""

from collections.abc import Iterator
from typing import Final

from manipnet.inputs.natnet.definitions import Definitions
from manipnet.inputs.natnet.frames import MocapFrame, RigidBody, Skeleton

LONGEST_ASK_S: Final = 30.0
"""The definitions are asked for at once when an unknown id arrives. If they do not name it, the pauses grow to this."""


class Names:
    """The newest definitions of a server."""

    def __init__(self) -> None:
        self.definitions = Definitions()
        self.bodies: dict[int, str] = {}
        """The names of the rigid bodies by their ids, as far as they are unambiguous."""
        self.conflicts: tuple[str, ...] = ()
        """What is ambiguous in the definitions."""
        self._bones: dict[int, tuple[list[int], list[str | None]]] = {}
        """The ids of the bones in the newest frame and their names, by the ids of the skeletons that are defined."""
        self._ids: frozenset[int] = frozenset()
        self._wanted = True
        self._unknown: set[object] = set()
        self._tries = 0
        """How often definitions came that did not name the unknown ids."""
        self._asked_s = float("-inf")
        self._present: tuple[list[int], list[int]] | None = None
        """The ids of bodies and skeletons in the newest frame, since there were definitions."""

    def forget(self) -> None:
        """Ask for the definitions again, because they may have changed."""
        self._wanted, self._tries = True, 0

    def define(self, definitions: Definitions) -> None:
        """Take new definitions."""
        self.definitions, self._wanted = definitions, False
        self.bodies, self.conflicts = definitions.names(), tuple(definitions.conflicts())
        self._bones.clear()
        self._ids, self._present = frozenset(id for id, _ in definitions.bodies), None
        self._tries += bool(self._unknown)

    def note(self, frame: MocapFrame) -> None:
        """Note which ids a frame has. One that is not defined is reason enough to ask."""
        if frame.models_changed:
            self.forget()
        present = [body[0] for body in frame.bodies], [skeleton[0] for skeleton in frame.skeletons]
        if present == self._present:
            self._wanted = self._wanted or bool(self._unknown)
            return
        self._present = present
        ids, skeletons = self._ids, self.definitions.skeletons
        unknown: set[object] = {body.id for body in frame.bodies if body.id not in ids}
        if frame.skeletons:
            unknown |= {f"skeleton {each.id}" for each in frame.skeletons if each.id not in skeletons}
        if unknown != self._unknown:
            self._unknown, self._tries = unknown, 0
            if unknown:
                self._asked_s = float("-inf")
        self._wanted = self._wanted or bool(unknown)

    def should_ask(self, now_s: float, period_s: float) -> bool:
        """Whether the definitions should be requested now; the caller then does so. Call this often."""
        pause_s = min(period_s * 2.0 ** min(self._tries, 10), max(period_s, LONGEST_ASK_S))
        if not self._wanted or now_s - self._asked_s < pause_s:
            return False
        self._asked_s = now_s
        return True

    def bones(self, frame: MocapFrame) -> Iterator[tuple[str, RigidBody]]:
        """The bones of a frame that have a name, with their names."""
        for skeleton in frame.skeletons:
            if skeleton.id in self.definitions.skeletons:
                for name, bone in zip(self._names_of(skeleton), skeleton.bones, strict=True):
                    if name is not None:
                        yield name, bone

    def _names_of(self, skeleton: Skeleton) -> list[str | None]:
        """The names of a skeleton's bones, which are looked up only when other bones come than in the frame before."""
        ids = [bone[0] for bone in skeleton.bones]
        found = self._bones.get(skeleton.id)
        if found is None or found[0] != ids:
            names = self.definitions.bones
            found = self._bones[skeleton.id] = ids, [names.get((skeleton.id, id & 0xFFFF)) for id in ids]
        return found[1]
