"""Where a camera looks: it frames what happens, and follows slowly until the visitor moves it himself."""

import time
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array
from manipnet.page.frames import Frame

UP: Final = np.array([0.0, 1.0, 0.0])
FIELD_OF_VIEW_RAD: Final = 0.62
DOWN_RAD: Final = 0.3
ASIDE_RAD: Final = 0.2
"""The camera looks down by the first angle, and stands aside by the second."""
SMALLEST_M: Final = 0.17
MARGIN: Final = 1.12
NEAR_M: Final = 0.45
"""A prop within this distance of a hand belongs to what happens."""
LEASH: Final = 0.25
"""What happens may leave the centre of the picture by this share of its radius before the camera follows."""
FOLLOW_S: Final = 1.2
"""The time constant with which the camera follows."""
SAME_M: Final = 1e-3
REMEMBERED: Final = 600
"""Poses that the camera was given, of 20 s, since a busy browser answers late. What it reports is one of them unless
the visitor has moved the camera."""


@dataclass(frozen=True, slots=True, eq=False)
class Focus:
    """What happens: a ball, and the horizontal direction from it to the place behind the actors' shoulders."""

    center: Array
    radius: float
    back: Array


NOTHING: Final = Focus(np.array([0.0, 0.09, 0.0]), 0.3, np.array([0.0, 0.0, 1.0]))
"""The empty table."""


def focus_of(frames: Iterable[Frame]) -> Focus | None:
    """The hands of all actors and the props near them; None if there are no hands."""
    hands = [hand for frame in frames for hand in frame.message.hands.items()]
    if not hands:
        return None
    joints = np.concatenate([hand.joints[:, :3] for _, hand in hands])
    props = [body.pose[:3] for frame in frames for body in frame.message.bodies if _is_near(body.pose[:3], joints)]
    points = np.concatenate([joints, np.array(props).reshape(-1, 3)])
    center = 0.5 * (points.min(axis=0) + points.max(axis=0))
    radius = max(float(np.linalg.norm(points - center, axis=1).max()), SMALLEST_M)
    wrists = {side: hand.wrist[:3] for side, hand in hands}
    across = wrists["right"] - wrists["left"] if len(wrists) == 2 else np.zeros(3)
    back = np.cross(across, UP)
    length = float(np.linalg.norm(back))
    return Focus(center, radius, back / length if length > 0.05 else NOTHING.back)


def camera_position(focus: Focus, aspect: float) -> Array:
    """Where a camera stands that has the whole ball in its picture, which is `aspect` times as wide as high."""
    half_rad = np.arctan(np.tan(0.5 * FIELD_OF_VIEW_RAD) * min(aspect, 1.0))
    aside = np.cos(ASIDE_RAD) * focus.back + np.sin(ASIDE_RAD) * np.cross(UP, focus.back)
    direction = np.cos(DOWN_RAD) * aside + np.sin(DOWN_RAD) * UP
    return focus.center + MARGIN * focus.radius / np.sin(half_rad) * direction


def _is_near(point: Array, joints: Array) -> bool:
    return bool(np.linalg.norm(joints - point, axis=1).min() < NEAR_M)


def begin_at_the_table(camera: viser.InitialCameraConfig) -> None:
    """Let every browser look at the empty table until its camera follows what happens."""
    camera.up = (0.0, 1.0, 0.0)
    camera.fov = FIELD_OF_VIEW_RAD
    camera.position = camera_position(NOTHING, 1.0)
    camera.look_at = NOTHING.center


class FollowCamera:
    """The camera of one visitor."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client = client
        self.following = True
        self._center, self._radius = NOTHING.center, NOTHING.radius
        self._back: Array | None = None
        self._moved_s: float | None = None
        self._given = deque[tuple[Array, Array]](maxlen=REMEMBERED)
        self._echoed = False
        """Whether the browser has reported a pose that it was given; what it reports before is its own beginning."""
        client.camera.on_update(self._reported)

    def restart(self) -> None:
        """Frame what happens with the next call of `follow`, and follow it from then on."""
        self.following, self._echoed, self._back, self._moved_s = True, False, None, None

    def state(self) -> dict[str, list[float]] | None:
        """Where the camera is and looks; None while it follows."""
        if self.following:
            return None
        camera = self._client.camera
        return {"position": np.array(camera.position).tolist(), "look_at": np.array(camera.look_at).tolist()}

    def stand(self, position: Sequence[float], look_at: Sequence[float]) -> None:
        """Stay at a place, as if the visitor had moved the camera there."""
        self.following = False
        camera = self._client.camera
        with self._client.atomic():
            camera.up_direction = (0.0, 1.0, 0.0)
            camera.position, camera.look_at = np.array(position, dtype=float), np.array(look_at, dtype=float)

    def follow(self, focus: Focus | None) -> None:
        """Move a little towards what happens; called for every frame that is shown."""
        if not self.following:
            return
        now_s = time.monotonic()
        focus = focus or NOTHING
        if self._back is None or self._moved_s is None:
            self._center, self._radius = focus.center, focus.radius
            self._back = focus.back if focus is not NOTHING else None
        else:
            self._approach(focus, 1.0 - np.exp(-(now_s - self._moved_s) / FOLLOW_S))
        self._moved_s = now_s
        self._look(focus.back if self._back is None else self._back)

    def _approach(self, focus: Focus, share: float) -> None:
        away = focus.center - self._center
        slack_m, distance_m = LEASH * self._radius, float(np.linalg.norm(away))
        if distance_m > slack_m:
            self._center = self._center + share * (1.0 - slack_m / distance_m) * away
        needed_m = focus.radius + min(distance_m, slack_m)
        if needed_m > self._radius or needed_m < 0.6 * self._radius:
            self._radius += share * (needed_m - self._radius)

    def _look(self, back: Array) -> None:
        camera = self._client.camera
        position = camera_position(Focus(self._center, self._radius, back), max(camera.aspect, 0.2))
        self._given.append((position, self._center))
        with self._client.atomic():
            camera.up_direction = (0.0, 1.0, 0.0)
            camera.fov = FIELD_OF_VIEW_RAD
            camera.position = tuple(position)
            camera.look_at = self._center

    async def _reported(self, camera: viser.CameraHandle) -> None:
        """Compare what the browser reports with what it was given: another pose means that the visitor moved it."""
        position, look_at = np.array(camera.position), np.array(camera.look_at)
        given = np.array(list(self._given)).reshape(-1, 2, 3)  # the drawing thread adds to it meanwhile
        is_same = np.abs(given - np.stack([position, look_at])).max(axis=2, initial=0.0) < SAME_M
        if is_same.any(axis=0).all():
            self._echoed = True
        elif self._echoed and self.following:
            self.following = False
