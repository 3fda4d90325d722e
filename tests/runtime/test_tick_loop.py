"""The loop without sockets: two props, two actors, and what happens when something inside it breaks."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from live_server import scene
from tracked_bodies import frame

from manipnet.actors.actor import Actor
from manipnet.actors.props import Prop
from manipnet.config.settings import WRISTS, ActorConfig, BodyConfig, default_actor
from manipnet.geometry import quat_exp
from manipnet.runtime.flight_recorder import FlightRecorder
from manipnet.runtime.mailbox import Mailbox
from manipnet.runtime.object_catalog import ObjectCatalog
from manipnet.runtime.status import SecondLines
from manipnet.runtime.tick_loop import TickLoop, second_after
from manipnet.synthesis.model.bundle import Bundle, load_bundle
from manipnet.synthesis.objects.library import LIBRARY_FOLDER
from manipnet.synthesis.synthesizer import HandStep, Synthesizer
from manipnet.telemetry import Telemetry
from manipnet.wire import HandsMessage, encode_msgpack
from manipnet.wire.numbers import numbers_of

HERE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def bundle(tiny_bundle: Path) -> Bundle:
    return load_bundle(tiny_bundle)


@pytest.fixture(scope="module")
def catalog() -> ObjectCatalog:
    return ObjectCatalog()


class Bench:
    """A loop whose clock is the frames' time, and the messages that it publishes."""

    def __init__(
        self, bundle: Bundle, folder: Path, actors: list[Actor], telemetry: Telemetry, synthesizer=None
    ) -> None:
        self.messages: list[HandsMessage] = []
        self.recorder = FlightRecorder(folder)
        self.is_broken = False
        """Whether publishing fails."""
        self.telemetry, self.mailbox, self.actors = telemetry, Mailbox(telemetry), actors
        self.loop = TickLoop(
            "session",
            actors,
            synthesizer or Synthesizer(bundle, on_stage=telemetry.stages.ended),
            self._publish,
            self.mailbox,
            self.recorder,
            telemetry,
        )

    def play(self, seconds: float, poses=scene, rate_hz: float = 120.0, start_s: float = 0.0) -> list[HandsMessage]:
        first = len(self.messages)
        for i in range(round(seconds * rate_hz)):
            t_s = start_s + i / rate_hz
            self.mailbox.put(frame(t_s, poses(t_s)))
            self.loop.take_in(0.0)
            while self.loop.step(t_s):
                pass
        return self.messages[first:]

    def _publish(self, message: HandsMessage) -> None:
        if self.is_broken:
            raise OSError("the cable is out")
        encode_msgpack(message)  # raises for a message that must not leave
        self.messages.append(message)


def actor(bundle: Bundle, catalog: ObjectCatalog, telemetry: Telemetry, *props: Prop, config=None) -> Actor:
    made = Actor(config or default_actor(), props, bundle, telemetry, 0.5)
    for prop in props:
        made.carry(prop.name, prop.object, prop.shape, prop.scale)
    return made


@pytest.fixture
def bench(bundle: Bundle, catalog: ObjectCatalog, tmp_path: Path):
    telemetry = Telemetry()
    return Bench(
        bundle, tmp_path, [actor(bundle, catalog, telemetry, Prop("Box", "cube", catalog.shape("cube")))], telemetry
    )


def test_each_hand_takes_the_nearest_prop_and_stays_with_it(bundle, catalog, tmp_path) -> None:
    telemetry = Telemetry()
    props = [Prop(name, "cube", catalog.shape("cube")) for name in ("cup", "pot")]
    bench = Bench(bundle, tmp_path, [actor(bundle, catalog, telemetry, *props)], telemetry)

    def poses(t_s: float):
        wobble = 0.01 * np.sin(40.0 * t_s)  # two props, each hand near one of them, the left one in the middle
        return {
            "left_wrist": (0.09 + wobble, 0.0, 0.03, 0.0, 0.0, 0.0, 1.0),
            "right_wrist": (0.3, 0.0, 0.03, 0.0, 0.0, 0.0, 1.0),
            "cup": (-0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            "pot": (0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
        }

    messages = bench.play(1.5, poses)
    assert {message.hands["right"].object for message in messages} == {"pot"}
    assert len({message.hands["left"].object for message in messages}) == 1


def test_two_actors_share_one_stream(bundle, catalog, tmp_path) -> None:
    telemetry = Telemetry()
    ann = ActorConfig("ann", {"left_wrist": BodyConfig(1), "right_wrist": BodyConfig("2")})
    bob = ActorConfig("bob", {"right_wrist": BodyConfig("bob")}, hand_scale=0.8)
    bench = Bench(
        bundle,
        tmp_path,
        [
            actor(bundle, catalog, telemetry, Prop("box", "cube", catalog.shape("cube")), config=ann),
            actor(bundle, catalog, telemetry, Prop("ball", "sphere", catalog.shape("sphere")), config=bob),
        ],
        telemetry,
    )
    poses = lambda t: {  # noqa: E731
        1: scene(t)["left_wrist"],
        2: scene(t)["right_wrist"],
        "box": scene(t)["Box"],
        "bob": (1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        "ball": (1.1, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    }
    messages = bench.play(1.0, poses)
    for name, sides, held in (("ann", {"left", "right"}, "box"), ("bob", {"right"}, "ball")):
        own = [message for message in messages if message.actor == name]
        assert [message.seq for message in own] == list(range(len(own)))
        assert len(own) == 30
        assert {frozenset(message.hands) for message in own} == {frozenset(sides)}
        assert {hand.object for message in own for hand in message.hands.values()} == {held}
    bobs = messages[-1].hands["right"]
    assert bobs.scale == 0.8
    knuckles = np.linalg.norm(bobs.joints[12, :3] - bobs.joints[1, :3])
    anns = next(m for m in reversed(messages) if m.actor == "ann").hands["right"]
    assert knuckles == pytest.approx(0.8 * np.linalg.norm(anns.joints[12, :3] - anns.joints[1, :3]))


def test_a_wrist_sits_on_its_body_at_its_offset(bundle, catalog, tmp_path) -> None:
    turn = quat_exp(np.array([0.0, np.pi / 2, 0.0]))
    config = ActorConfig("a", {"right_wrist": BodyConfig(3, np.array([0.0, 0.0, 0.1, *turn]))})
    telemetry = Telemetry()
    bench = Bench(bundle, tmp_path, [actor(bundle, catalog, telemetry, config=config)], telemetry)
    (wrist,) = {tuple(m.hands["right"].wrist.round(6)) for m in bench.play(0.6, lambda _: {3: HERE})}
    assert wrist == pytest.approx((0.0, 0.0, 0.1, *turn), abs=1e-6)


class Faulty:
    """A synthesizer that fails at chosen calls, by an exception or by NaN."""

    def __init__(self, bundle: Bundle, breaks, how: str) -> None:
        self._inner, self._breaks, self._how, self.calls = Synthesizer(bundle), breaks, how, 0

    def step(self, scenes, states) -> list[HandStep]:
        self.calls += bool(scenes)
        steps = self._inner.step(scenes, states)
        if self.calls in self._breaks and scenes:
            if self._how == "raise":
                raise RuntimeError("the network is on fire")
            for step in steps:
                step.angles[3] = step.state.angles[3] = np.nan
        return steps


@pytest.mark.parametrize("how", ["raise", "nan"])
def test_after_an_internal_error_the_last_good_pose_stays_a_dump_is_written_and_the_ticks_go_on(
    bundle, catalog, tmp_path: Path, how: str
) -> None:
    telemetry = Telemetry()
    actors = [actor(bundle, catalog, telemetry, Prop("Box", "cube", catalog.shape("cube")))]
    bench = Bench(bundle, tmp_path, actors, telemetry, Faulty(bundle, {20, 21, 22}, how))
    messages = bench.play(1.5)
    assert [message.seq for message in messages] == list(range(60))
    states = [message.hands["left"].state for message in messages]
    assert [i for i, state in enumerate(states) if state == "hold"] == [19, 20, 21]
    assert set(states) == {"live", "hold"}
    held = [message.hands["left"].angles for message in messages[18:22]]
    assert all(np.array_equal(held[0], angles) for angles in held)
    assert sum(telemetry.counts()["tick_errors"].values()) == 3
    bench.recorder.finish()
    (dump,) = tmp_path.glob("manipnet-*.json")
    content = json.loads(dump.read_text())
    assert content["error"]
    assert len(content["frames"]) > 60
    assert "left_wrist" in content["ticks"][0]["bodies"]


def test_an_error_in_one_actors_plan_holds_that_actor_only(bench: Bench, monkeypatch) -> None:
    bench.play(0.8)
    monkeypatch.setattr(bench.actors[0], "plan", lambda tick: 1 / 0)
    held = bench.play(0.2, start_s=0.8)
    monkeypatch.undo()
    after = bench.play(0.4, start_s=1.0)
    assert {hand.state for message in held for hand in message.hands.values()} == {"hold"}
    assert after[-1].hands["left"].state == "live"
    assert bench.telemetry.counts()["tick_errors"]["plan"] == len(held)


def test_a_message_that_cannot_be_published_is_counted_and_later_ones_go_out(bench: Bench) -> None:
    before = bench.play(0.6)
    bench.is_broken = True
    assert bench.play(0.2, start_s=0.6) == []
    lost = bench.telemetry.counts()["tick_errors"]["publish"]
    bench.is_broken = False
    after = bench.play(0.2, start_s=0.8)
    assert lost == 12
    assert [message.seq for message in after] == list(range(len(before) + lost, len(before) + lost + 12))
    assert {hand.state for message in after for hand in message.hands.values()} == {"live"}
    assert bench.telemetry.counts()["tick_errors"] == {"publish": lost}


def test_a_frame_whose_check_fails_costs_only_itself(bench: Bench, monkeypatch) -> None:
    bench.play(0.6)
    monkeypatch.setattr(bench.loop._intake._gate, "check", lambda frame: 1 / 0)
    bench.play(0.1, start_s=0.6)
    monkeypatch.undo()
    assert bench.telemetry.counts()["tick_errors"] == {"input": 12}
    assert bench.play(0.3, start_s=0.7)[-1].hands["left"].state == "live"


def test_ticks_go_on_if_nobody_can_be_shown_them(bench: Bench, caplog) -> None:
    class Broken:
        watched = True

        def see(self, *_: object) -> None:
            raise OSError("the page has gone")

    bench.loop._observer = Broken()  # pyright: ignore[reportAttributeAccessIssue]: it fails whatever it is given
    assert len(bench.play(1.0)) == len(bench.messages) > 0
    assert "a tick cannot be shown on the page" in caplog.text


def test_the_loop_goes_on_if_a_second_cannot_be_reported(bench: Bench, caplog) -> None:
    seconds: list[float] = []

    def report(now_s: float) -> None:
        seconds.append(now_s)
        raise ValueError("no such sender")

    bench.loop.run(lambda: len(seconds) == 2, report)
    assert seconds[1] - seconds[0] > 0.5
    assert "cannot be reported" in caplog.text


def test_the_line_of_a_second_tells_that_hands_are_out_and_then_their_rate(bench: Bench) -> None:
    lines = SecondLines(bench.actors, bench.telemetry)
    assert lines.next(10.0).status.startswith("waiting for bodies")
    bench.play(1.0)
    assert lines.next(11.0).status.startswith("the first hands are out | left")
    bench.play(1.0, start_s=1.0)
    assert lines.next(12.5).status.startswith("40 hands/s | delay ")


@pytest.mark.parametrize(
    ("now_s", "next_s"), [(5.0, 6.0), (5.002, 6.0), (5.49, 6.0), (5.6, 7.0), (5.999, 7.0), (8.3, 9.0)]
)
def test_a_second_is_reported_half_a_second_after_the_last_one_or_later(now_s: float, next_s: float) -> None:
    assert second_after(now_s, 5.0) == pytest.approx(next_s)


def test_a_hand_smaller_than_the_models_sees_a_larger_world(bundle, catalog) -> None:
    config = ActorConfig("child", {wrist: BodyConfig(wrist) for wrist in WRISTS}, hand_scale=0.5)
    telemetry = Telemetry()
    child = actor(bundle, catalog, telemetry, Prop("Box", "cube", catalog.shape("cube"), 0.7), config=config)
    for i in range(70):
        child.push(frame(i / 120, scene(i / 120)))
    tick = child.poll(1.0)
    assert tick is not None
    seen = child.plan(tick).scenes["left"]
    assert seen.scale == pytest.approx(1.4)
    assert np.allclose(seen.wrist[:, :3], 2.0 * tick.bodies["left_wrist"].window[:, :3])
    assert np.allclose(seen.wrist[:, 3:], tick.bodies["left_wrist"].window[:, 3:])


def test_the_same_mesh_is_built_once() -> None:
    catalog = ObjectCatalog()
    cube = LIBRARY_FOLDER / "cube.ply"
    one, other = catalog.load(cube), catalog.load(cube)
    assert one is other
    assert one.name == "cube"


def test_the_numbers_of_a_message_are_those_of_its_parts(
    bundle: Bundle, catalog: ObjectCatalog, tmp_path: Path
) -> None:
    telemetry = Telemetry()
    shape = catalog.shape("cube")
    actor = Actor(default_actor(), [Prop("prop", "cube", shape)], bundle, telemetry, 0.1)
    messages = Bench(bundle, tmp_path, [actor], telemetry).play(1.0)
    assert messages
    for message in messages:
        assert message.numbers is not None, "they were not found sound"
        np.testing.assert_array_equal(message.numbers, numbers_of(message))
        assert replace(message, seq=0).numbers is None, "a changed copy must be checked again"
