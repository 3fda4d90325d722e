"""Makes the bodies of a frame from what arrived, and from earlier values of what was not sent again.

Some senders send a value only when it has changed. A value that was not sent again is as it was, as long as anything
about its body arrives. Of a sender that is known to send only changes, a body that is not mentioned at all is as it was
for `STANDS_S`.
"""

from typing import Any, Final

from manipnet.inputs.osc.patterns import EULER, POSITION, QUATERNION
from manipnet.inputs.osc.reader import BodyKey
from manipnet.inputs.osc.space import Converter, Numbers
from manipnet.wire.bodies import CONFLICT, MAX_BODIES, MAX_NAME_CHARS, BodySample, make_sample

Fields = dict[str, Any]
"""What arrived about one body: numbers by the name of the field, and the converter of single components."""

REFUSED: Final = "refused"
"""A field that says that two bodies have the same key."""
STANDS_S: Final = 30.0
"""How long the values of a body stand after anything about it has arrived."""
CHANGES_ONLY_FRAMES: Final = 3
"""A sender that leaves out the same part of a body so often in a row, while it sends the other, sends only changes."""
TOGETHER_S: Final = 0.05
"""A rotation that comes this soon after a position belongs to it, though it has a datagram of its own."""
_NOWHERE: Final = ((0.0,) * 3, (0.0,) * 4)


class BodyMemory:
    """The newest values of each body of one sender."""

    def __init__(self, expected: frozenset[BodyKey] = frozenset()) -> None:
        """`expected` are the bodies of the rig."""
        self.sends_changes_only = False
        self._expected = expected
        self._known: dict[BodyKey, _Known] = {}
        self._names: dict[BodyKey, str] = {}

    def name(self, key: BodyKey, name: str) -> None:
        """Note the name of a body or of a bone, which the sender otherwise calls by its number."""
        if len(self._names) < MAX_BODIES and 0 < len(name) <= MAX_NAME_CHARS and name.isprintable():
            if isinstance(key, str):
                name = f"{key.rpartition(':')[0]}:{name}"
            self._names[key] = name

    def halves(self) -> dict[str, str]:
        """Bodies of which only a part has ever arrived, with what is missing. From any thread."""
        known = list(self._known.items())
        return {str(key): each.missing for key, each in known if each.missing}

    def conflicts(self) -> list[str]:
        """Bodies whose key two bodies of the sender have. From any thread."""
        return [str(key) for key, each in list(self._known.items()) if each.refused]

    def samples(self, bodies: dict[BodyKey, Fields], now_s: float) -> tuple[BodySample, ...]:
        """The bodies of a frame from the fields that arrived."""
        samples: list[BodySample] = []
        has_news = False
        for key, fields in bodies.items():
            known = self._known.get(key)
            if known is None or now_s - known.heard_s > STANDS_S:
                known = self._remember(key)
            has_news = known.take(fields, now_s) or has_news
            self.sends_changes_only = self.sends_changes_only or abs(known.left_out) >= CHANGES_ONLY_FRAMES
            sample = self._sample(key, known)
            if sample is not None:
                samples.append(sample)
        if not has_news:
            return ()
        if self.sends_changes_only:
            samples += self._standing(bodies, now_s)
        return tuple(samples)

    def _remember(self, key: BodyKey) -> "_Known":
        if key not in self._known and len(self._known) >= MAX_BODIES:
            del self._known[min(self._known, key=lambda each: self._known[each].heard_s)]
        self._known[key] = _Known()
        return self._known[key]

    def _standing(self, bodies: dict[BodyKey, Fields], now_s: float) -> list[BodySample]:
        """The bodies that are not mentioned in a frame because nothing about them has changed."""
        others = [
            self._sample(key, known)
            for key, known in self._known.items()
            if key not in bodies and TOGETHER_S < now_s - known.heard_s <= STANDS_S and not known.missing
        ]
        return [sample for sample in others if sample is not None]

    def _sample(self, key: BodyKey, known: "_Known") -> BodySample | None:
        id, name = (key, self._names.get(key)) if isinstance(key, int) else (None, key)
        if id is None and self._names and self._names.get(key) in self._expected:
            name = self._names[key]
        if known.refused:
            return BodySample(id, name, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), False, CONFLICT)
        if known.p is None or known.q is None:
            return None if known.tracked else make_sample(id, name, *_NOWHERE, False)
        return make_sample(id, name, known.p, known.q, known.tracked)


class _Known:
    """The newest values of one body."""

    __slots__ = ("_components", "heard_s", "left_out", "missing", "p", "p_heard_s", "q", "refused", "tracked")

    def __init__(self) -> None:
        self.p: Numbers | None = None
        self.q: Numbers | None = None
        self.tracked, self.refused = True, False
        self.heard_s = self.p_heard_s = float("-inf")
        self.left_out = 0
        """For how many frames in a row the rotation was not sent, or, below zero, the position."""
        self.missing = ""
        """What has never arrived: "position", "rotation" or both."""
        self._components: dict[str, float] = {}

    def take(self, fields: Fields, now_s: float) -> bool:
        """Take what arrived; returns whether it is more than the rotation of a position that was used before."""
        self.heard_s = now_s
        self.refused = REFUSED in fields
        tracked = fields.get("tracked")
        if tracked is not None:
            self.tracked = tracked[0] != 0.0
        pose = fields.get("local") or fields.get("transformation")  # of the two in VMC, "local" is not scaled
        if pose is not None:
            self.p, self.q, self.p_heard_s, self.missing, self.left_out = pose[:3], pose[3:], now_s, "", 0
            return True
        p, q = fields.get("position"), fields.get("quat")
        if "converter" in fields:
            p, q = self._converted(fields)
        self.p, self.q = p or self.p, q or self.q
        parts = {"position": self.p is None, "rotation": self.q is None}
        if not all(parts.values()) or self._components:
            self.missing = " and ".join(part for part, is_missing in parts.items() if is_missing)
        return self._count(p, q, now_s)

    def _count(self, p: Numbers | None, q: Numbers | None, now_s: float) -> bool:
        is_late_half = p is None and q is not None and now_s - self.p_heard_s < TOGETHER_S
        if p is not None:
            self.p_heard_s = now_s
            self.left_out = 0 if q is not None else max(self.left_out, 0) + 1
        elif q is not None:
            self.left_out = min(self.left_out, 0) - 1
        return not is_late_half

    def _converted(self, fields: Fields) -> tuple[Numbers | None, Numbers | None]:
        """The position and the rotation, as far as they are known, from single components of them."""
        converter: Converter = fields["converter"]
        given = {name: value[0] for name, value in fields.items() if name in _COMPONENTS}
        self._components |= given
        known = self._components
        p = q = None
        if given.keys() & {*POSITION} and known.keys() >= {*POSITION}:
            p = converter.position(tuple(known[name] for name in POSITION))
        if given.keys() & {*QUATERNION} and known.keys() >= {*QUATERNION}:
            q = converter.rotation(tuple(known[name] for name in QUATERNION))
        elif given.keys() & {*EULER} and known.keys() >= {*EULER}:
            q = converter.euler(tuple(known[name] for name in EULER))
        return p, q


_COMPONENTS: Final = frozenset((*POSITION, *QUATERNION, *EULER))
