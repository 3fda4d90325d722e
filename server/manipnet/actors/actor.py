"""One actor: which streamed bodies are its wrists and props, and its two hands from tick to tick."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from manipnet.actors.output_guard import OutputGuard
from manipnet.actors.props import Prop, choose_prop
from manipnet.actors.transitions import HOLD_AFTER_S, PoseTransition, Shown, State, state_at_age
from manipnet.config.settings import WRISTS, ActorConfig, BodyConfig, BodyKey
from manipnet.geometry import Array, compose, invert
from manipnet.synthesis.hand.skeleton import DOF_NAMES
from manipnet.synthesis.model.bundle import Bundle
from manipnet.synthesis.objects.shape import Shape
from manipnet.synthesis.synthesizer import HandScene, HandState, HandStep, Side, state_of
from manipnet.telemetry import Telemetry
from manipnet.tracking.timeline import TICK_S, BodyAtTick, BodyHealth, Tick, Timeline
from manipnet.wire.bodies import BodyFrame, BodySample

SIDES: Final[tuple[Side, Side]] = ("left", "right")
AT_REST_RAD: Final = 0.03
"""Fingers this near to the rest pose are there."""
ON_THE_BODY: Final = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
"""The offset of what is its body."""


@dataclass(frozen=True, slots=True)
class ShownHand:
    """One hand as an actor shows it at a tick, and the prop its fingers belong to."""

    shown: Shown
    prop: str | None


class LiveHand:
    """One hand's memory: what it was synthesised to, what it shows, and which prop it is about."""

    def __init__(self, side: Side, rest_angles: Array, limits: Array, telemetry: Telemetry) -> None:
        self.side: Side = side
        self.prop: str | None = None
        self.resting = False
        """Asked to rest: no synthesis until the hand has eased there."""
        self._rest_angles = rest_angles
        self._presence = PoseTransition(rest_angles, OutputGuard(limits, telemetry))
        self.memory = state_of(rest_angles)

    @property
    def shown(self) -> Shown | None:
        """What was shown last."""
        return self._presence.shown

    def show(
        self, state: State, step: HandStep | None, wrist: Array | None, run: int, dt_s: float, known: bool
    ) -> ShownHand | None:
        """The hand `dt_s` after the last tick: live with a `step`, else held or on its way to rest."""
        if state == "live" and step is None:
            state = "hold"
        angles = None if step is None else step.angles
        if state == "rest":
            self.prop = None
        shown = self._presence.show(state, angles, wrist, run, self.prop, dt_s, known)
        if step is not None:
            self.memory = step.state
        elif state == "rest":
            self.memory = state_of(self._rest_angles)
        return None if shown is None else ShownHand(shown, self.prop)

    def recover(self) -> None:
        """Go on from what is shown: the memory cannot be trusted."""
        self.memory = state_of(self._rest_angles if self.shown is None else self.shown.angles)

    def at_rest(self) -> bool:
        """Whether the fingers have reached the rest pose."""
        return self.shown is None or bool(np.abs(self.shown.angles - self._rest_angles).max() < AT_REST_RAD)


@dataclass(frozen=True, slots=True)
class Plan:
    """What one tick of one actor needs: the scenes to synthesise, and the state of each hand before it."""

    tick: Tick
    states: Mapping[Side, State]
    scenes: Mapping[Side, HandScene]
    memories: Mapping[Side, HandState]


class Actor:
    """An actor's bodies in, its hands out. Not thread-safe: belongs to the tick thread."""

    def __init__(
        self, config: ActorConfig, props: Sequence[Prop], bundle: Bundle, telemetry: Telemetry, look_ahead_s: float
    ) -> None:
        self.config = config
        self.timeline = Timeline(look_ahead_s)
        self.props = list(props)
        self.seq = 0
        self.paused = False
        """Asked to pause: both hands stay as they are shown, wherever the wrists go."""
        limits = _limits(config, bundle.limits)
        rest_angles = np.clip(bundle.rest_angles, *limits.T)
        self.hands: dict[Side, LiveHand] = {
            side: LiveHand(side, rest_angles, limits, telemetry) for side in SIDES if f"{side}_wrist" in config.wrists
        }
        self._parts, self._offsets = _parts(config), _offsets(config)
        self._last: tuple[int, int] | None = None

    def push(self, frame: BodyFrame) -> str | None:
        """Take what a frame holds of this actor; returns why nothing of it was used, or None."""
        poses: dict[str, Array | None] = {}
        for sample in frame.bodies:
            part = self._parts.get(sample.id) if sample.id is not None else None
            part = part or (self._parts.get(sample.name) if sample.name is not None else None)
            if part is not None:
                poses[part] = _pose(sample, self._offsets.get(part)) if sample.tracked else None
        if not poses:
            return "unknown_body"
        return self.timeline.push(frame.t_s, poses, frame.t_received_s, frame.source)

    def expected(self) -> list[BodyKey]:
        """Ids and names of the bodies this actor consists of."""
        bodies = (*self.config.wrists.values(), *(thing.body for thing in self.config.objects))
        return [body.key for body in bodies]

    def carry(self, body: BodyKey, object_name: str, shape: Shape, scale: float) -> Prop:
        """Let a body, by its key in the stream or its name here, carry a shape from now on.

        Raises `ValueError` for the body of a wrist.
        """
        name = self.part(body)
        if name is None:
            name = str(body)
            self._parts |= dict.fromkeys(_aliases(body), name)
        if name in WRISTS:
            raise ValueError(f"body {body!r} is the {name}; give the body of a prop")
        prop = Prop(name, object_name, shape, scale)
        self.props = [other for other in self.props if other.name != name] + [prop]
        return prop

    def reshape(self, old: Shape, new: Shape) -> None:
        """Whatever carries the shape `old` carries `new` from now on."""
        self.props = [replace(prop, shape=new) if prop.shape is old else prop for prop in self.props]

    def part(self, body: BodyKey) -> str | None:
        """What this actor calls a body, given by its key in the stream or by that name; None for a stranger."""
        return self._parts.get(body) or (str(body) if body in self._parts.values() else None)

    def body_poses(self, part: str, seconds: float) -> Array:
        """The body itself of a wrist or prop, without its offset, in the newest `seconds`: `(n, 7)`."""
        return compose(self.timeline.recent(part, seconds), invert(self.offset(part)))

    def offset(self, part: str) -> Array:
        """Where a wrist or prop sits on its body, `(7,)`."""
        return self._offsets.get(part, ON_THE_BODY)

    def place(self, part: str, offset: Array) -> None:
        """Let a wrist or prop sit elsewhere on its body from now on: `offset (7,)` is T_body_part."""
        self.timeline.move(part, compose(invert(self.offset(part)), offset))
        self._offsets[part] = offset
        config = self.config
        wrists = {name: _placed(body, offset) if name == part else body for name, body in config.wrists.items()}
        objects = (replace(o, body=_placed(o.body, offset)) if o.name == part else o for o in config.objects)
        self.config = replace(config, wrists=wrists, objects=tuple(objects))

    def resize_hands(self, hand_scale: float) -> None:
        """The hands are of another size from now on."""
        self.config = replace(self.config, hand_scale=hand_scale)

    def rest(self) -> None:
        """Ease both hands to the rest pose; they are synthesised anew from there."""
        for hand in self.hands.values():
            hand.resting = True

    def plan(self, tick: Tick) -> Plan:
        """Who of this actor is to be synthesised at this tick, and from what."""
        states: dict[Side, State] = {}
        scenes: dict[Side, HandScene] = {}
        for side, hand in self.hands.items():
            wrist = tick.bodies.get(f"{side}_wrist")
            prop = None if wrist is None else choose_prop(side, wrist.pose, self.props, tick.bodies, hand.prop)
            thing = None if prop is None else tick.bodies[prop.name]
            states[side] = self._state(hand, wrist, thing)
            if prop is not None:
                hand.prop = prop.name
            if states[side] == "live" and wrist is not None and prop is not None and thing is not None:
                scenes[side] = self._scene(side, wrist, tick.bodies.get(f"{_other(side)}_wrist"), thing, prop)
        return Plan(tick, states, scenes, {side: self.hands[side].memory for side in scenes})

    def show(self, plan: Plan, steps: Mapping[Side, HandStep]) -> dict[Side, ShownHand]:
        """Both hands at the plan's tick, from the steps that were synthesised for it.

        Raises `NotFiniteError`, after which `hold` shows the tick.
        """
        dt_s = self._elapsed_s(plan.tick)
        hands: dict[Side, ShownHand] = {}
        for side, hand in self.hands.items():
            wrist = plan.tick.bodies.get(f"{side}_wrist")
            tracked = wrist is not None and wrist.age_s <= HOLD_AFTER_S and not self.paused
            pose = wrist.pose if wrist is not None and (tracked or hand.shown is None) else None
            known = wrist is None or wrist.known
            shown = hand.show(plan.states[side], steps.get(side), pose, plan.tick.run, dt_s, known)
            if shown is not None:
                hands[side] = shown
        self._last = (plan.tick.run, plan.tick.index)
        return hands

    def hold(self, tick: Tick) -> dict[Side, ShownHand]:
        """Both hands as they were shown last, for a tick that failed."""
        self._last = (tick.run, tick.index)
        return {
            side: ShownHand(replace(hand.shown, state="hold"), hand.prop)
            for side, hand in self.hands.items()
            if hand.shown is not None
        }

    def health(self, now_s: float) -> dict[str, BodyHealth]:
        """Of every body of the rig, as the stream has it now; one never heard of has an infinite age."""
        heard = self.timeline.health(now_s)
        parts = dict.fromkeys(self._parts.values())
        return {name: heard.get(name, BodyHealth(0.0, np.inf)) for name in parts}

    def recover(self) -> None:
        """Go on from what is shown: what led to an error is forgotten."""
        for hand in self.hands.values():
            hand.recover()

    def _state(self, hand: LiveHand, wrist: BodyAtTick | None, thing: BodyAtTick | None) -> State:
        if self.paused:
            return "hold"
        if hand.resting:
            hand.resting = not hand.at_rest()
            return "rest"
        ages = [np.inf if body is None else body.age_s for body in (wrist, thing)]
        return state_at_age(max(ages))

    def _scene(
        self, side: Side, wrist: BodyAtTick, other: BodyAtTick | None, thing: BodyAtTick, prop: Prop
    ) -> HandScene:
        """The scene as the model's hand would see it: for a larger hand everything is smaller."""
        size = self.config.hand_scale
        other_window = None if other is None or other.age_s > HOLD_AFTER_S else _shrunk(other.window, size)
        wrist_window, thing_window = _shrunk(wrist.window, size), _shrunk(thing.window, size)
        return HandScene(side, wrist_window, other_window, thing_window, prop.shape, prop.scale / size)

    def _elapsed_s(self, tick: Tick) -> float:
        """Stream time since the last tick shown; across a restart of the sender, one tick."""
        if self._last is None or self._last[0] != tick.run:
            return TICK_S
        return (tick.index - self._last[1]) * TICK_S


def _shrunk(window: Array, size: float) -> Array:
    return window if size == 1.0 else window * np.append(np.full(3, 1.0 / size), np.ones(4))


def _parts(config: ActorConfig) -> dict[BodyKey, str]:
    """What each body is to this actor."""
    parts = {alias: wrist for wrist, body in config.wrists.items() for alias in _aliases(body.key)}
    return parts | {alias: thing.name for thing in config.objects for alias in _aliases(thing.body.key)}


def _offsets(config: ActorConfig) -> dict[str, Array]:
    """Where each part sits on its body, unless it is that body."""
    bodies = config.wrists | {thing.name: thing.body for thing in config.objects}
    return {part: body.offset for part, body in bodies.items() if body.offset is not None}


def _limits(config: ActorConfig, limits: Array) -> Array:
    """The model's limits `(20, 2)`, narrowed as the actor's rig says."""
    limits = limits.copy()
    for name, ends in config.limits.items():
        limits[DOF_NAMES.index(name)] = np.clip(ends, *limits[DOF_NAMES.index(name)])
    return limits


def _placed(body: BodyConfig, offset: Array) -> BodyConfig:
    return replace(body, offset=offset)


def _aliases(key: BodyKey) -> tuple[BodyKey, ...]:
    """A number is the same body whether it comes as an id or, from some bridges, as a name."""
    if isinstance(key, int):
        return key, str(key)
    return (key, int(key)) if key.isdecimal() else (key,)


def _pose(sample: BodySample, offset: Array | None) -> Array:
    pose = np.array([*sample.p, *sample.q])
    return pose if offset is None else compose(pose, offset)


def _other(side: Side) -> Side:
    return "right" if side == "left" else "left"
