"""What two hands do with an object in one take, drawn by chance: lift, carry and put down, hand over, hold together,
come near without grasping, and rest."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.random import Generator

from manipnet.geometry import (
    SIDES,
    Array,
    Side,
    quat_conjugate,
    quat_exp,
    quat_multiply,
    quat_rotate,
    transform,
)
from manipnet_tools.assets.minimum_jerk import Move
from manipnet_tools.generate.bank import Held, apart, of_side
from manipnet_tools.generate.motions import Hold, Scene, Shift
from manipnet_tools.generate.proposals import CONE_RAD

EVENTS: Final = ("lift", "hand over", "together", "near", "idle")
_SHARES: Final = (0.36, 0.18, 0.34, 0.07, 0.05)
_HANDS_APART_M: Final = 0.022
_UP: Final = np.array([0.0, 1.0, 0.0])
_TABLE_SHARE: Final = 0.75
"""How many takes have a table, through which no hand reaches for the object."""
_OTHER: Final[dict[Side, Side]] = {"left": "right", "right": "left"}


class Director:
    """Draws the events of one take."""

    def __init__(self, grasps: Sequence[Held], vertices: Array, rng: Generator) -> None:
        """`vertices (V, 3)` of the object, in its frame."""
        self._grasps, self._rng = grasps, rng
        self._vertices = vertices[:: max(len(vertices) // 300, 1)]
        self._table = rng.random() < _TABLE_SHARE
        self._moves: list[Move] = []
        self._holds: list[Hold] = []
        self._pose = self._at_rest()
        self.events: list[dict] = []
        """What happened: kind of event, side, kind of grasp, and when it began and ended."""

    def direct(self, length_s: float) -> Scene:
        """A scene of about this length."""
        rng, start = self._rng, self._pose
        now = float(rng.uniform(0.2, 0.8))
        while now < length_s:
            event = str(rng.choice(EVENTS, p=_SHARES))
            sides: list[Side] = list(SIDES) if rng.random() < 0.5 else list(reversed(SIDES))
            now = {
                "lift": self._lift,
                "hand over": self._hand_over,
                "together": self._together,
                "near": self._near,
                "idle": lambda now, _: now + float(rng.uniform(0.8, 2.0)),
            }[event](now, sides)
            now += float(rng.uniform(0.0, 0.4))
        return Scene(now + 0.3, start, tuple(self._moves), tuple(self._holds))

    def _lift(self, now: float, sides: list[Side]) -> float:
        rng = self._rng
        grasp = self._reachable(sides[0]) or self._reachable(sides[1])
        if grasp is None:
            return self._press(now)
        contact = now + rng.uniform(0.6, 1.2)
        release = contact + rng.uniform(1.5, 4.5)
        self._carry(contact + rng.uniform(0.03, 0.2), release - rng.uniform(0.05, 0.15), [grasp], lands=True)
        return self._hold("lift", grasp, now, contact, release)

    def _hand_over(self, now: float, sides: list[Side]) -> float:
        rng = self._rng
        first = self._reachable(sides[0])
        second = first and self._beside(first)
        if first is None or second is None:
            return self._lift(now, sides)
        contact = now + rng.uniform(0.6, 1.1)
        taken = contact + rng.uniform(1.4, 3.0)
        release, end = taken + rng.uniform(0.25, 0.7), taken + rng.uniform(2.0, 4.0)
        self._carry(contact + 0.1, taken - 0.5, [first], lands=False)
        self._carry(release + 0.1, end - 0.1, [second], lands=True)
        done = self._hold("hand over", first, now, contact, release)
        return max(done, self._hold("hand over", second, taken - rng.uniform(0.6, 1.0), taken, end))

    def _together(self, now: float, sides: list[Side]) -> float:
        rng = self._rng
        first = self._reachable(sides[0])
        second = first and self._beside(first)
        if first is None or second is None:
            return self._lift(now, sides)
        contact, lag = now + rng.uniform(0.6, 1.1), rng.uniform(0.0, 0.5)
        release = contact + lag + rng.uniform(1.5, 4.5)
        self._carry(contact + lag + 0.1, release - 0.1, [first, second], lands=True)
        done = self._hold("together", first, now, contact, release)
        return max(done, self._hold("together", second, now + lag, contact + lag, release - rng.uniform(0.0, 0.3)))

    def _press(self, now: float) -> float:
        """Both hands at once on an object that is too wide for one."""
        rng = self._rng
        pairs = [(one, self._partner(one)) for one in self._grasps if one.pair >= 0 and one.side == "right"]
        if not pairs:
            return now
        drawn = [pairs[int(k)] for k in rng.choice(len(pairs), min(3, len(pairs)), replace=False)]
        pair = max(drawn, key=lambda both: sum(self._ease(grasp, self._pose[3:]) for grasp in both))
        contact = now + rng.uniform(0.7, 1.2)
        release = contact + rng.uniform(1.5, 4.5)
        self._carry(contact + rng.uniform(0.1, 0.25), release - rng.uniform(0.05, 0.15), pair, lands=True)
        return max(self._hold("together", grasp, now, contact, release) for grasp in pair)

    def _partner(self, grasp: Held) -> Held:
        return next(other for other in self._grasps if other.pair == grasp.pair and other.side != grasp.side)

    def _near(self, now: float, sides: list[Side]) -> float:
        rng = self._rng
        grasp = self._reachable(sides[0])
        if grasp is None:
            return now
        contact = now + rng.uniform(0.5, 1.0)
        return self._hold("near", grasp, now, contact, contact + rng.uniform(0.1, 0.8))

    def _hold(self, event: str, grasp: Held, reach: float, contact: float, release: float) -> float:
        away = release + float(self._rng.uniform(0.5, 0.95))
        self._holds.append(
            Hold(
                grasp.side,
                reach,
                contact,
                release,
                away,
                grasp.pose,
                grasp.angles,
                grasp.opened,
                grasp.back,
                event == "near",
                () if event == "near" else self._shifts(grasp, contact, release),
            )
        )
        self.events.append(
            {
                "event": event,
                "side": grasp.side,
                "grasp": grasp.kind,
                "start_s": round(contact, 3),
                "end_s": round(release, 3),
            }
        )
        return away

    def _shifts(self, grasp: Held, contact: float, release: float) -> tuple[Shift, ...]:
        """The wrist wanders about its grasp, and the fingers follow."""
        rng, near = self._rng, [(grasp.pose, grasp.angles), *grasp.shifts]
        shifts: list[Shift] = []
        now = contact + float(rng.uniform(0.1, 0.6))
        while len(near) > 1 and now < release - 0.5:
            pose, angles = near[int(rng.integers(len(near)))]
            end = min(now + float(rng.uniform(0.25, 0.8)), release - 0.1)
            shifts.append(Shift(now, end, pose, angles))
            now = end + float(rng.uniform(0.0, 0.8))
        return tuple(shifts)

    def _reachable(self, side: Side) -> Held | None:
        """A grasp of the object as it is now, with the forearm on the person's side and above the table."""
        own = [grasp for grasp in of_side(self._grasps, side) if grasp.pair < 0]
        if not own:
            return None
        best, best_value = None, -np.inf
        for k in self._rng.choice(len(own), min(5, len(own)), replace=False):
            grasp = own[int(k)]
            joints = transform(self._pose, grasp.joints)
            lowest = transform(self._pose, self._vertices)[:, 1].min()
            value = self._ease(grasp, self._pose[3:])
            if self._table:
                value += min((joints[:, 1].min() - lowest) / 0.01 - 1.0, 0.0)
            if value > best_value:
                best, best_value = grasp, value
        return best

    def _beside(self, grasp: Held) -> Held | None:
        """A grasp of the other hand that leaves room for this one."""
        others = [other for other in of_side(self._grasps, _OTHER[grasp.side]) if apart(grasp, other, _HANDS_APART_M)]
        return others[int(self._rng.integers(len(others)))] if others else None

    def _ease(self, grasp: Held, quat: Array) -> float:
        """How easily an arm reaches: the forearm points back, outward and down rather than away."""
        forearm = -quat_rotate(quat_multiply(quat, grasp.pose[3:]), np.array([1.0, 0.0, 0.0]))
        outward = 1.0 if grasp.side == "right" else -1.0
        return float(min(forearm @ np.array([0.35 * outward, -0.25, 0.9]), 0.4))

    def _carry(self, start: float, end: float, grasps: Sequence[Held], lands: bool) -> None:
        """Move the object about while it is held, and put it down at the end if it `lands`."""
        rng, now = self._rng, start
        first = True
        while now < end - 0.35:
            length = float(rng.uniform(0.5, 1.5))
            last = lands and now + 1.4 * length > end - 0.35
            stop = end if last else min(now + length, end)
            if last:
                pose = self._at_rest()
            else:
                step = rng.normal(0.0, [0.11, 0.09, 0.11]) + ([0.0, 0.1, 0.0] if first else [0.0, 0.0, 0.0])
                place = np.clip(self._pose[:3] + step, [-0.3, -0.05, -0.3], [0.3, 0.4, 0.3])
                pose = np.concatenate([place, self._turned(grasps)])
            self._moves.append(Move(now, stop, pose))
            self._pose, first = pose, False
            if last:
                break
            now += length * float(rng.uniform(0.55, 1.0))

    def _turned(self, grasps: Sequence[Held]) -> Array:
        """A random orientation in which these grasps hold the object, and the arms are at ease."""
        rng, best, best_value = self._rng, self._pose[3:], -np.inf
        tied = [grasp.downs[0] for grasp in grasps if not _any_way(grasp)]
        for _ in range(14):
            if tied:
                base = quat_multiply(_yaw(rng.uniform(0, 2 * np.pi)), _aligning(tied[0], -_UP))
                quat = quat_multiply(quat_exp(rng.normal(0.0, 0.15, 3)), base)
            else:
                quat = quat_multiply(quat_exp(rng.normal(0.0, rng.choice([0.2, 0.5, 1.1]), 3)), self._pose[3:])
            down = quat_rotate(quat_conjugate(quat), -_UP)
            off = max([float(np.arccos(np.clip(down @ way, -1, 1))) - CONE_RAD for way in tied], default=0.0)
            value = 2.0 * min(-off, 0.0) + sum(self._ease(grasp, quat) for grasp in grasps)
            value -= 0.15 * _angle(quat, self._pose[3:])
            if value > best_value:
                best, best_value = quat, value
        return best

    def _at_rest(self) -> Array:
        """The object upright at a random place, turned about the vertical."""
        rng = self._rng
        place = rng.normal(0.0, [0.08, 0.0, 0.06])
        pose = np.concatenate([place, _yaw(rng.uniform(0.0, 2.0 * np.pi))])
        pose[1] -= transform(pose, self._vertices)[:, 1].min() + 0.1
        return pose


def _any_way(grasp: Held) -> bool:
    """Whether a grasp holds however the object is turned."""
    return bool(np.linalg.norm(grasp.downs.sum(axis=0)) < 1e-6)


def _yaw(angle: float) -> Array:
    return np.array([0.0, np.sin(angle / 2.0), 0.0, np.cos(angle / 2.0)])


def _angle(a: Array, b: Array) -> float:
    return float(2.0 * np.arccos(min(1.0, abs(float(a @ b)))))


def _aligning(direction: Array, target: Array) -> Array:
    """The smallest rotation, as a quaternion, that turns one unit vector into another."""
    axis, cosine = np.cross(direction, target), float(direction @ target)
    if cosine < -0.9999:
        return np.array([1.0, 0.0, 0.0, 0.0]) if abs(direction[0]) < 0.9 else np.array([0.0, 0.0, 1.0, 0.0])
    quat = np.array([*axis, 1.0 + cosine])
    return quat / np.linalg.norm(quat)
