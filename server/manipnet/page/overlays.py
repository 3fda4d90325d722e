"""What can be drawn over a hand: its sensors, its contacts, the targets of inverse kinematics, and its future path."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import viser
from numpy.typing import NDArray

from manipnet.geometry import Array
from manipnet.page.frames import Frame, PropView, ShapeView
from manipnet.page.hand_look import HandLook
from manipnet.page.hand_models import HandModel, wxyz
from manipnet.page.prop_models import PropModels
from manipnet.page.sensor_snapshot import SensorView, SensorViews
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.sensing.ambient import CELL_M, CELL_OFFSETS_M
from manipnet.synthesis.sensing.scene import SENSOR_RANGE_M
from manipnet.wire import Side

CONTACT_M: Final = 0.004
"""A sensor within this distance of the surface counts as a contact."""
NEAR, FAR = np.array([255.0, 92.0, 60.0]), np.array([70.0, 140.0, 255.0])
AMBIENT_COLOR: Final = (255, 190, 80)
CONTACT_COLOR: Final = (255, 72, 40)
TARGET_COLOR: Final = (80, 255, 160)
RAW_COLOR: Final = (255, 255, 255)
PATH_COLOR: Final = (140, 190, 255)
LAYERS: Final = "/live/layers"
"""The node above the layers; below it each layer has one of its own, which a visitor can hide."""


@dataclass(frozen=True, slots=True)
class Layer:
    """What the page says about a layer: its name, what it means, and its colours."""

    label: str
    meaning: str
    colors: tuple[tuple[int, int, int], ...]


OVERLAYS: Final = {
    "contacts": Layer("Contacts", "where the skin is within 4 mm of the object", (CONTACT_COLOR,)),
    "proximity": Layer(
        "Distance rays", "from the skin to the object: near is red, far is blue", ((255, 92, 60), (70, 140, 255))
    ),
    "ambient": Layer(
        "Sensed space", "the parts of the object that the network feels around the hand", (AMBIENT_COLOR,)
    ),
    "targets": Layer(
        "Solver", "from the network's joints, white, to where the solver wants them, green", (RAW_COLOR, TARGET_COLOR)
    ),
    "ghost": Layer("Half a second ahead", "where hands and objects will be, which the network knows", (PATH_COLOR,)),
}
"""The layers by key, the most useful first."""
OF_SENSORS: Final = frozenset({"ambient", "proximity", "contacts", "targets"})
"""Overlays that need a sensor view."""
OCCUPIED: Final = 0.3
"""A cell is drawn if at least this share of it is inside the object."""


class HandOverlays:
    """The sensors, contacts and targets of one hand, each layer under `root/LAYER/name`.

    They are children of the wrist, because browsers move a node and its children at once, but draw new points later.
    """

    def __init__(self, scene: viser.SceneApi, root: str, name: str, hand: Hand) -> None:
        sensor_count, joint_count = hand.sensor_count, hand.joint_count
        ambient, proximity, contacts, targets = (
            f"{root}/{layer}/{name}" for layer in ("ambient", "proximity", "contacts", "targets")
        )
        self._wrists = [scene.add_frame(each, show_axes=False) for each in (ambient, proximity, contacts, targets)]
        self._ambient = _points(scene, f"{ambient}/cells", len(CELL_OFFSETS_M), 0.35 * CELL_M, AMBIENT_COLOR)
        self._rays = scene.add_line_segments(
            f"{proximity}/rays",
            np.zeros((sensor_count, 2, 3)),
            np.zeros((sensor_count, 2, 3), np.uint8),
            thickness=1.5,
            thickness_units="screen",
        )
        self._points = _points(scene, f"{proximity}/sensors", sensor_count, 0.0035)
        self._contacts = _points(scene, f"{contacts}/points", sensor_count, 0.009, CONTACT_COLOR)
        self._raw = _points(scene, f"{targets}/raw", joint_count, 0.004, RAW_COLOR)
        self._targets = _points(scene, f"{targets}/targets", joint_count, 0.007, TARGET_COLOR)
        self._target_lines = scene.add_line_segments(
            f"{targets}/lines", np.zeros((joint_count, 2, 3)), TARGET_COLOR, thickness=2.0, thickness_units="screen"
        )

    def show(self, sensors: SensorView | None, shown: set[str]) -> None:
        """Draw the overlays in `shown`; without a sensor view, hide all of them."""
        shown = shown if sensors is not None else set()
        self._ambient.visible = "ambient" in shown
        self._rays.visible = self._points.visible = "proximity" in shown
        self._contacts.visible = "contacts" in shown
        self._raw.visible = self._targets.visible = self._target_lines.visible = "targets" in shown
        if sensors is None:
            return
        for wrist in self._wrists:
            wrist.position, wrist.wxyz = sensors.wrist[:3], wxyz(sensors.wrist[3:])
        if "ambient" in shown:
            self._show_ambient(sensors)
        if "proximity" in shown:
            self._show_proximity(sensors)
        if "contacts" in shown:
            # the other points are moved into the first contact, because the number of points must not change
            near = np.abs(sensors.readings) < CONTACT_M
            self._contacts.visible = bool(near.any())
            if near.any():
                self._contacts.points = _f32(np.where(near[:, None], sensors.points, sensors.points[near][0]))
        if "targets" in shown:
            self._raw.points, self._targets.points = _f32(sensors.raw), _f32(sensors.targets)
            self._target_lines.points = _f32(np.stack([sensors.raw, sensors.targets], axis=1))

    def _show_ambient(self, sensors: SensorView) -> None:
        full = sensors.ambient > OCCUPIED
        self._ambient.visible = bool(full.any())
        if full.any():
            self._ambient.points = _f32(np.where(full[:, None], sensors.cells, sensors.cells[full][0]))

    def _show_proximity(self, sensors: SensorView) -> None:
        nearness = 1.0 - np.clip(np.abs(sensors.readings) / SENSOR_RANGE_M, 0.0, 1.0)[:, None]
        colors = np.round(FAR + nearness * (NEAR - FAR)).astype(np.uint8)
        hit = (sensors.readings < SENSOR_RANGE_M)[:, None]
        ends = sensors.points + np.where(hit, sensors.readings[:, None], 0.0) * sensors.normals
        self._points.points, self._points.colors = _f32(sensors.points), colors
        self._rays.points = _f32(np.stack([sensors.points, ends], axis=1))
        self._rays.colors = np.repeat(colors[:, None], 2, axis=1)


class Ghost:
    """The poses of one actor's wrists and props at the end of the window, and the paths to them."""

    def __init__(self, scene: viser.SceneApi, name: str, look: HandLook) -> None:
        self._scene, self._name, self._look = scene, name, look
        self._hands: dict[Side, HandModel] = {}
        self._props = PropModels(scene, f"{name}/props", ghost=True)
        self._paths: dict[str, viser.LineSegmentsHandle] = {}

    def show(self, frame: Frame, shapes: dict[str, ShapeView], visible: bool) -> None:
        """Draw one tick."""
        message = frame.message
        ends = {name: window[-1] for name, window in frame.windows.items()}
        self._props.show(frame.props, shapes, ends, visible)
        for side, hand in message.hands.items():
            end = ends.get(f"{side}_wrist")
            if visible and end is not None:
                if side not in self._hands or self._hands[side].scale != hand.scale:
                    self._hands[side] = HandModel(
                        self._scene, f"{self._name}/{side}", self._look, side, hand.scale, ghost=True
                    )
                self._hands[side].pose(hand, end)
        for side, model in self._hands.items():
            model.show(visible and side in message.hands and f"{side}_wrist" in ends)
        for name, window in frame.windows.items():
            if visible or name in self._paths:
                self._path(name, window).visible = visible

    def _path(self, name: str, window: Array) -> viser.LineSegmentsHandle:
        future = window[len(window) // 2 :, :3]
        segments = _f32(np.stack([future[:-1], future[1:]], axis=1))
        if name not in self._paths:
            self._paths[name] = self._scene.add_line_segments(
                f"{self._name}/path/{name}", segments, PATH_COLOR, thickness=2.0, thickness_units="screen"
            )
        self._paths[name].points = segments
        return self._paths[name]


class ActorOverlays:
    """All overlays of the actor `name`, each layer under `root/LAYER`."""

    def __init__(self, scene: viser.SceneApi, root: str, name: str, look: HandLook) -> None:
        self._scene, self._root, self._name = scene, root, name
        self._hand, self._sensor_views = look.hand, SensorViews(look.hand)
        self._hands: dict[Side, HandOverlays] = {}
        self._ghost = Ghost(scene, f"{root}/ghost/{name}", look)

    def show(self, frame: Frame, shapes: dict[str, ShapeView], shown: set[str]) -> None:
        """Draw the overlays in `shown` of one tick."""
        self._ghost.show(frame, shapes, "ghost" in shown)
        props = {prop.name: prop for prop in frame.props}
        for side in ("left", "right"):
            sensors = self._view(frame, side, props, shapes) if shown & OF_SENSORS else None
            if sensors is not None and side not in self._hands:
                self._hands[side] = HandOverlays(self._scene, self._root, f"{self._name}/{side}", self._hand)
            if side in self._hands:
                self._hands[side].show(sensors, shown)

    def _view(
        self, frame: Frame, side: Side, props: dict[str, PropView], shapes: dict[str, ShapeView]
    ) -> SensorView | None:
        hand = frame.hands.get(side)
        prop = None if hand is None else props.get(hand.prop)
        if prop is None or prop.content_hash not in shapes or side not in frame.message.hands:
            return None
        return self._sensor_views.view(frame, side, shapes[prop.content_hash], prop.scale)


def _f32(values: np.ndarray) -> NDArray[np.float32]:
    return values.astype(np.float32)


def _points(
    scene: viser.SceneApi, name: str, count: int, size_m: float, color: tuple[int, int, int] = (255, 255, 255)
) -> viser.PointCloudHandle:
    return scene.add_point_cloud(
        name,
        np.zeros((count, 3)),
        color,
        point_size=size_m,
        point_shape="circle",
        point_shading="flat",
        precision="float32",
    )
