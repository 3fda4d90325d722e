"""Interpolates hands by capture time, a chosen delay behind, for any display rate, and fades them on loss."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .clock import SmoothClock
from .layout import RATE_HZ
from .message import Body, Hand, Hands
from .spline import spline_weights

RING = 32
"""Number of frames that are kept."""

HOLD_S, FADE_S, BLEND_S = 0.5, 0.5, 0.2
"""On silence the pose is held and then faded; afterwards the display moves from the held pose to the stream."""

STALE_S, STALE_LIMIT_S = 0.25, 0.5
"""A frame that is later than the first is dropped, unless all frames are late for longer than the second."""


@dataclass(frozen=True)
class Shown:
    """The hands to draw. `weight` falls from 1 to 0 when the stream is lost; use it to blend to another animation."""

    hands: Hands
    weight: float


class Interpolator:
    """Interpolates the frames of one actor, which lie on the 60 Hz grid of their capture times. Not thread-safe."""

    def __init__(self, delay_s: float = 0.1) -> None:
        self.delay_s = delay_s
        self.late = 0
        self._frames: dict[int, Hands] = {}
        self._clock = SmoothClock()
        self._newest: Hands | None = None
        self._shown: Shown | None = None
        self._held: Hands | None = None
        self._t0 = self._now = self._resumed_s = 0.0
        self._stale_since_s: float | None = None
        self._starved = False

    def push(self, frame: Hands, arrival_s: float) -> bool:
        """Add a frame that arrived at `arrival_s` of the local clock; returns False if it came too late."""
        if self._newest and frame.session == self._newest.session and frame.seq <= self._newest.seq:
            self.late += 1
            return False
        if self._is_other_stream(frame):
            self._restart(frame)
        elif self._is_stale(frame, arrival_s):
            self.late += 1
            return False
        elif self._newest and frame.t_capture - self._newest.t_capture >= RING / RATE_HZ:
            self._frames.clear()
        self._clock.observe(arrival_s, frame.t_capture)
        self._newest = frame
        grid = self._grid(frame)
        self._frames[grid] = frame
        for old in [g for g in self._frames if g <= grid - RING]:
            del self._frames[old]
        return True

    def sample(self, now_s: float) -> Shown | None:
        """The hands to show at the local time `now_s`, which must not decrease; None before the first frame."""
        if self._newest is None:
            return None
        position = (self._clock.capture_time(now_s) - self.delay_s - self._t0) * RATE_HZ
        hands = _mix(self._frames, spline_weights(position, self._frames), position)
        starved_s = (position - self._grid(self._newest)) / RATE_HZ
        hands = self._eased(hands, starved_s, now_s)
        self._shown = Shown(hands, self._weight(starved_s, now_s))
        self._now = now_s
        return self._shown

    def _is_other_stream(self, frame: Hands) -> bool:
        """Whether the frame is the first one, begins a new session, or has an earlier time, as when a take loops."""
        newest = self._newest
        if newest is None or frame.session != newest.session:
            return True
        return frame.t_capture < newest.t_capture - 0.5 / RATE_HZ

    def _restart(self, frame: Hands) -> None:
        self._frames.clear()
        self._clock = SmoothClock()
        self._t0, self._stale_since_s = frame.t_capture, None
        self._starved = self._shown is not None

    def _is_stale(self, frame: Hands, arrival_s: float) -> bool:
        """Whether the frame is backlog after a stall; if frames stay late for long, the clock has changed instead."""
        if arrival_s - frame.t_capture - self._clock.target_s <= STALE_S:
            self._stale_since_s = None
            return False
        if self._stale_since_s is None:
            self._stale_since_s = arrival_s
        if arrival_s - self._stale_since_s <= STALE_LIMIT_S:
            return True
        self._restart(frame)
        return False

    def _grid(self, frame: Hands) -> int:
        return round((frame.t_capture - self._t0) * RATE_HZ)

    def _eased(self, hands: Hands, starved_s: float, now_s: float) -> Hands:
        """The hands, blended with the held pose for a short time after a gap."""
        if starved_s > 1.0 / RATE_HZ:
            self._starved = True
        elif self._starved:
            self._starved, self._resumed_s = False, self._now
            self._held = self._shown.hands if self._shown else None
        if self._held is None or (part := (now_s - self._resumed_s) / BLEND_S) >= 1.0:
            self._held = None
            return hands
        s = _smoothstep(part)
        return _mix({0: self._held, 1: hands}, {0: 1.0 - s, 1: s}, 1.0)

    def _weight(self, starved_s: float, now_s: float) -> float:
        weight = 1.0 - _smoothstep((starved_s - HOLD_S) / FADE_S)
        if self._shown is None:
            return weight
        return min(weight, self._shown.weight + (now_s - self._now) / FADE_S)


def _smoothstep(x: float) -> float:
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


def _mix(frames: dict[int, Hands], weights: dict[int, float], position: float) -> Hands:
    """The weighted mean of frames; values that cannot be averaged come from the frame nearest to `position`."""
    nearest = min(weights, key=lambda g: abs(g - position))
    reference = frames[nearest]
    parts = [(frames[g], w) for g, w in weights.items() if w != 0.0]
    hands = {side: _mix_hand(side, reference.hand(side), parts) for side in ("left", "right")}
    bodies = tuple(_mix_body(i, body, parts) for i, body in enumerate(reference.bodies))
    return replace(reference, bodies=bodies, **hands)


def _mix_hand(side: str, reference: Hand | None, parts: list[tuple[Hands, float]]) -> Hand | None:
    if reference is None:
        return None
    present = [(hand, w) for frame, w in parts if (hand := frame.hand(side)) is not None]
    if len(present) < len(parts):  # the hand appears or disappears here, so it is not in all frames
        return reference
    return replace(
        reference,
        angles=sum(w * hand.angles for hand, w in present),
        rotations=_mix_quats(reference.rotations, [(h.rotations, w) for h, w in present]),
        wrist=_mix_poses(reference.wrist, [(h.wrist, w) for h, w in present]),
        joints=_mix_poses(reference.joints, [(h.joints, w) for h, w in present]),
    )


def _mix_body(index: int, reference: Body, parts: list[tuple[Hands, float]]) -> Body:
    poses = []
    for frame, w in parts:
        if index >= len(frame.bodies) or frame.bodies[index].name != reference.name:
            return reference
        poses.append((frame.bodies[index].pose, w))
    return replace(reference, pose=_mix_poses(reference.pose, poses))


def _mix_poses(reference: np.ndarray, parts: list[tuple[np.ndarray, float]]) -> np.ndarray:
    position = sum(w * pose[..., :3] for pose, w in parts)
    quat = _mix_quats(reference[..., 3:], [(pose[..., 3:], w) for pose, w in parts])
    return np.concatenate([position, quat], axis=-1)


def _mix_quats(reference: np.ndarray, parts: list[tuple[np.ndarray, float]]) -> np.ndarray:
    """The normalised weighted sum of quaternions, each with the sign that is nearer to the reference."""
    total = np.zeros_like(reference)
    for quat, w in parts:
        dot = np.sum(quat * reference, axis=-1, keepdims=True)
        total += np.where(dot < 0.0, -w, w) * quat
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    return np.where(length > 1e-6, total / np.maximum(length, 1e-6), reference)
