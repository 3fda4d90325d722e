"""What the page lays over a hand belongs to the very tick whose hand it shows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from live_server import scene
from tracked_bodies import frame as body_frame

from manipnet.actors.actor import Actor
from manipnet.actors.props import Prop
from manipnet.config.settings import default_actor
from manipnet.geometry import invert, mirror_points, quat_to_matrix, transform
from manipnet.page.frames import Frame, ShapeView
from manipnet.page.hand_models import world_bones
from manipnet.page.sensor_snapshot import SensorViews
from manipnet.page.supervisor import frame_of
from manipnet.runtime.flight_recorder import FlightRecorder
from manipnet.runtime.mailbox import Mailbox
from manipnet.runtime.object_catalog import ObjectCatalog
from manipnet.runtime.tick_loop import TickLoop
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.sensing.scene import SENSOR_RANGE_M
from manipnet.synthesis.synthesizer import Synthesizer
from manipnet.telemetry import Telemetry

HAND = shipped_hand()

HAND_SIZE, PROP_SIZE = 0.9, 1.3


@pytest.fixture(scope="module")
def prop() -> Prop:
    return Prop("Box", "cube", ObjectCatalog().shape("cube"), PROP_SIZE)


class TickObserver:
    """Keeps every tick as the page would get it."""

    watched = True

    def __init__(self) -> None:
        self.frames: list[Frame] = []

    def see(self, actor, plan, message) -> None:
        self.frames.append(frame_of(actor, plan.tick, plan.steps, message))


@pytest.fixture(scope="module")
def frames(prop: Prop, tiny_bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Frame]:
    """Half a second of two moving hands of another size than the model's, on a box of another size than its mesh."""
    bundle, telemetry = load_bundle(tiny_bundle), Telemetry()
    actor = Actor(replace(default_actor(), hand_scale=HAND_SIZE), [prop], bundle, telemetry, 0.1)
    actor.carry(prop.name, prop.object, prop.shape, prop.scale)
    observer, mailbox = TickObserver(), Mailbox(telemetry)
    recorder = FlightRecorder(tmp_path_factory.mktemp("dumps"))
    rest = lambda message: None, mailbox, recorder, telemetry, observer
    loop = TickLoop("session", [actor], Synthesizer(bundle), *rest)
    for k in range(180):
        mailbox.put(body_frame(k / 120, scene(k / 120), k))
        loop.take_in(0.0)
        while loop.step(k / 120):
            pass
    return observer.frames[-30:]


@pytest.mark.parametrize("side", ["left", "right"])
def test_layers_are_where_the_hand_of_their_tick_is(frames: list[Frame], prop: Prop, side) -> None:
    mesh = prop.shape.mesh
    shape = ShapeView(prop.object, prop.shape.content_hash, mesh.vertices, mesh.faces)
    views = SensorViews(HAND)
    for frame in frames:
        hand, sensors = frame.message.hands[side], views.view(frame, side, shape, PROP_SIZE)
        on_skin = place_sensors(side, hand.angles, hand.wrist)
        points, targets = (transform(sensors.wrist, local) for local in (sensors.points, sensors.targets))
        np.testing.assert_allclose(points, on_skin, atol=1e-6)
        np.testing.assert_allclose(sensors.wrist, hand.wrist)
        np.testing.assert_allclose(sensors.raw[0], 0.0, atol=1e-9)
        joints = world_bones(HAND, side, HAND_SIZE, hand.angles, hand.wrist)[0]
        assert np.linalg.norm(targets - joints, axis=1).max() < 0.25
        assert np.linalg.norm(sensors.cells.mean(axis=0)) == pytest.approx(
            HAND_SIZE * np.linalg.norm(HAND.sensors.grid_center), abs=1e-9
        )
        T_object_world = invert(next(body.pose for body in frame.message.bodies if body.name == "Box"))
        hits = np.abs(sensors.readings) < 0.9 * HAND_SIZE * SENSOR_RANGE_M
        assert hits.any()
        ends = transform(sensors.wrist, sensors.points + sensors.readings[:, None] * sensors.normals)
        ends = transform(T_object_world, ends)[hits]
        distance, *_ = prop.shape.signed_distance(ends / PROP_SIZE)
        assert np.abs(PROP_SIZE * distance).max() < 1e-3


def place_sensors(side, angles, wrist):
    """The skin's sensors on the shown bones `(104, 3)`, in the world."""
    mirrored = mirror_points if side == "left" else np.asarray
    positions, quats = world_bones(HAND, side, HAND_SIZE, angles, wrist)
    turned = np.einsum("sbij,sbj->sbi", quat_to_matrix(quats)[HAND.sensors.bones], mirrored(HAND.sensors.points))
    return (HAND.sensors.weights[..., None] * (positions[HAND.sensors.bones] + HAND_SIZE * turned)).sum(axis=1)
