"""Props that clients request: bounded in number, and the one requested longest ago makes room."""

import numpy as np
import pytest

from manipnet.actors.actor import Actor
from manipnet.actors.props import Prop
from manipnet.config.settings import MAX_OBJECTS, BodyConfig, ObjectConfig, default_actor
from manipnet.synthesis.model.bundle import Bundle, load_bundle
from manipnet.synthesis.objects.library import library_file
from manipnet.synthesis.objects.shape import load_shape
from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import BodyFrame, BodySample

CUBE = load_shape("cube")


@pytest.fixture(scope="module")
def bundle(tiny_bundle) -> Bundle:
    return load_bundle(str(tiny_bundle))


def actor(bundle: Bundle, objects: int = 1) -> Actor:
    """An actor whose rig has props."""
    mesh = library_file("cube")
    assert mesh is not None
    things = tuple(ObjectConfig(f"Rig{i}", BodyConfig(f"Rig{i}"), mesh) for i in range(objects))
    props = [Prop(thing.name, "cube", CUBE) for thing in things]
    return Actor(default_actor(things), props, bundle, Telemetry(), 0.0)


def stream(actor: Actor, names: list[str], since_s: float = 0.0) -> None:
    """Half a second of frames in which the named bodies are tracked, and the ticks of them."""
    for i in range(60):
        t_s = since_s + i / 120.0
        samples = tuple(BodySample(None, name, (1e-3 * i, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0), True) for name in names)
        actor.push(BodyFrame(t_s, i, samples, t_s, "zmq:test"))
        while (tick := actor.poll(t_s)) is not None:
            actor.plan(tick)


def names(actor: Actor) -> list[str]:
    return [prop.name for prop in actor.props]


def test_the_prop_requested_longest_ago_makes_room(bundle) -> None:
    one = actor(bundle)
    for i in range(MAX_OBJECTS + 3):
        one.carry(f"more{i}", "cube", CUBE, 1.0)
    assert len(one.props) == MAX_OBJECTS
    assert names(one)[0] == "Rig0"
    assert names(one)[1:3] == ["more4", "more5"]
    assert one.role("more0") is None
    one.carry("more4", "cube", CUBE, 2.0)
    one.carry("another", "cube", CUBE, 1.0)
    assert "more4" in names(one), "it was requested again"
    assert "more5" not in names(one)


def test_a_tracked_prop_makes_room_last_and_its_history_goes(bundle) -> None:
    one = actor(bundle)
    one.carry("seen", "cube", CUBE, 1.0)
    one.place("seen", np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
    for i in range(MAX_OBJECTS - 2):
        one.carry(f"more{i}", "cube", CUBE, 1.0)
    stream(one, ["left_wrist", "seen"])
    for i in range(MAX_OBJECTS - 2):
        one.carry(f"other{i}", "cube", CUBE, 1.0)
    assert "seen" in names(one)
    everything = [name for name in names(one) if name != "Rig0"]
    one.hands["left"].prop = "other0"
    stream(one, ["left_wrist", *everything], since_s=0.5)
    one.carry("late", "cube", CUBE, 1.0)
    assert "seen" not in names(one), "all are tracked, and it was requested first"
    assert "seen" not in one.health(1.0)
    assert one.body_poses("seen", 1.0).shape == (0, 7)
    one.hands["left"].prop = next(iter(names(one)[1:]))
    one.carry("later", "cube", CUBE, 1.0)
    assert one.hands["left"].prop in names(one), "what is held stays"
    one.carry("seen", "cube", CUBE, 1.0)
    assert one.offset("seen").tolist() == [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]


def test_the_props_of_the_rig_never_make_room(bundle) -> None:
    full = actor(bundle, MAX_OBJECTS)
    with pytest.raises(ValueError, match="already has 32 props, all of them in the rig or held"):
        full.carry("more", "cube", CUBE, 1.0)
    full.carry("Rig3", "cube", CUBE, 2.0)
    assert len(full.props) == MAX_OBJECTS
