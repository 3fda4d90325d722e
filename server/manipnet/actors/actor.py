"""One actor: its tracked bodies come in, its two hands go out, tick by tick."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from manipnet.actors.body_roles import BodyRoles
from manipnet.actors.live_hand import LiveHand
from manipnet.actors.plan import Plan, make_scene
from manipnet.actors.props import Prop, choose_prop
from manipnet.actors.transitions import HOLD_AFTER_S, ShownHand, state_at_age
from manipnet.config.settings import MAX_OBJECTS, WRISTS, ActorConfig, BodyKey
from manipnet.geometry import Array, compose, invert
from manipnet.synthesis.model.bundle import Bundle
from manipnet.synthesis.objects.shape import Shape
from manipnet.synthesis.synthesizer import HandScene, HandState
from manipnet.telemetry import Telemetry
from manipnet.tracking.tick import TICK_S, BodyAtTick, BodyHealth, Tick
from manipnet.tracking.timecodes import Timecode, Timecodes
from manipnet.tracking.timeline import Timeline
from manipnet.wire import SIDES, Side, State
from manipnet.wire.bodies import BodyFrame, BodySample


class Actor:
    """A pair of hands, the props they may hold, and the stream of their bodies. Belongs to the tick thread."""

    def __init__(
        self,
        config: ActorConfig,
        props: Sequence[Prop],
        bundle: Bundle,
        telemetry: Telemetry,
        look_ahead_s: float,
        start_delay_s: float = 0.0,
    ) -> None:
        """`start_delay_s` is that of `Timeline`."""
        self.config = config
        self.props = list(props)
        self.seq = 0
        """Number of the next message."""
        self.paused = False
        """Whether both hands stay as they are shown."""
        self.model_hand = bundle.hand
        """The hand that is synthesised, of size 1."""
        limits = _limits(config, bundle)
        rest_angles = np.clip(bundle.rest_angles, *limits.T)
        self.hands: dict[Side, LiveHand] = {
            side: LiveHand(bundle.hand, side, rest_angles, limits, telemetry)
            for side in SIDES
            if f"{side}_wrist" in config.wrists
        }
        self._telemetry = telemetry
        self._roles, self._timeline = BodyRoles(config), Timeline(look_ahead_s, start_delay_s=start_delay_s)
        self._timecodes = Timecodes()
        self._last: tuple[int, int] | None = None
        self._tracked: frozenset[str] = frozenset()
        """The roles whose bodies were tracked at the newest tick."""

    # --- the stream

    @property
    def look_ahead_s(self) -> float:
        """The requested look-ahead, 0 … `MAX_LOOK_AHEAD_S`; the ticks are slewed until it is reached."""
        return self._timeline.look_ahead_s

    @look_ahead_s.setter
    def look_ahead_s(self, seconds: float) -> None:
        self._timeline.look_ahead_s = seconds

    @property
    def receiving(self) -> bool:
        """Whether any frame with a body of this actor has arrived."""
        return self._timeline.running

    @property
    def sender_restarts(self) -> int:
        """How often the sender's clock restarted."""
        return self._timeline.restarts

    @property
    def ticks_skipped(self) -> int:
        """How many ticks were not shown because they fell due all at once or a sender restarted."""
        return self._timeline.skipped_late + self._timeline.skipped_at_restart

    def push(self, frame: BodyFrame, bodies: Mapping[BodyKey, BodySample] | None = None) -> str | None:
        """Take this actor's bodies from a frame; returns why none of them was used, or None.

        `bodies` are `frame.by_key()`, which several actors share. The reasons are those of `Timeline.push`, and
        unknown_body.
        """
        poses = self._roles.poses(frame.by_key() if bodies is None else bodies)
        if not poses:
            return "unknown_body"
        if frame.timecode is not None:
            self._timecodes.note(frame.t_s, frame.timecode, frame.timecode_rate)
        restarts = self._timeline.restarts
        reason = self._timeline.push(frame.t_s, poses, frame.t_received_s, frame.source)
        if self._timeline.restarts > restarts:
            self._telemetry.count("sender_restarts", source=frame.source.partition(":")[0])
        return reason

    def timecode(self, t_s: float) -> Timecode:
        """The timecode of an instant of stream time, as far as the tracker sends one."""
        return self._timecodes.at(t_s)

    def poll(self, now_s: float) -> Tick | None:
        """The next tick that is due at `now_s`, or None. Call this again until it returns None."""
        timeline = self._timeline
        late, at_restart = timeline.skipped_late, timeline.skipped_at_restart
        tick = timeline.poll(now_s)
        if timeline.skipped_late > late:
            self._telemetry.count("ticks_skipped", timeline.skipped_late - late, reason="backlog")
        if timeline.skipped_at_restart > at_restart:
            self._telemetry.count("ticks_skipped", timeline.skipped_at_restart - at_restart, reason="restart")
        return tick

    def next_poll_s(self, now_s: float) -> float:
        """When the next tick falls due if no frame arrives before, as `Timeline.next_poll_s` has it."""
        return self._timeline.next_poll_s(now_s)

    def awaited(self) -> tuple[str, float] | None:
        """The sender and the time of the frame that lets the next tick fall due, as `Timeline.awaited` has it."""
        return self._timeline.awaited()

    def health(self, now_s: float) -> dict[str, BodyHealth]:
        """How every body arrives at present, by its role; a body that never arrived has an infinite age."""
        arriving = self._timeline.health(now_s)
        return {role: arriving.get(role, BodyHealth(0.0, np.inf)) for role in self._roles.names()}

    def body_keys(self) -> dict[str, BodyKey]:
        """The body of each wrist and prop, by id or name."""
        return self._roles.keys()

    # --- bodies and props

    def expected(self) -> list[BodyKey]:
        """Streaming ids and names of the bodies in the rig."""
        return [body.key for body in (*self.config.wrists.values(), *(prop.body for prop in self.config.objects))]

    def role(self, body: BodyKey) -> str | None:
        """The role of a body, which is given by its key in the stream or by its role; None if it has none."""
        return self._roles.role(body)

    def carry(self, body: BodyKey, object_name: str, shape: Shape, scale: float) -> Prop:
        """Let a body, which is given by its key in the stream or by its role, carry an object from now on.

        If the actor has `MAX_OBJECTS` props already, a prop that was requested before is given back for a new one.
        Raises `ValueError` for the body of a wrist, and if no prop can be given back.
        """
        if self._roles.role(body) is None and len(self.props) >= MAX_OBJECTS:
            self._give_back()
        name = self._roles.assign(body)
        if name in WRISTS:
            raise ValueError(f"body {body!r} is the {name}, which cannot carry an object; give the body of a prop")
        prop = Prop(name, object_name, shape, scale)
        self.props = [other for other in self.props if other.name != name] + [prop]
        return prop

    def _give_back(self) -> None:
        """Forget the prop that was requested longest ago: one that is not tracked, or else one that is not held."""
        kept = {prop.name for prop in self.config.objects} | {hand.prop for hand in self.hands.values()}
        free = [prop.name for prop in self.props if prop.name not in kept]
        if not free:
            raise ValueError(f"{self.config.name} already has {MAX_OBJECTS} props, all of them in the rig or held")
        name = next((name for name in free if name not in self._tracked), free[0])
        self.props = [prop for prop in self.props if prop.name != name]
        self._roles.forget(name)
        self._timeline.forget(name)

    def reshape(self, old: Shape, new: Shape) -> None:
        """Replace the shape `old` by `new` in every prop."""
        self.props = [replace(prop, shape=new) if prop.shape is old else prop for prop in self.props]

    def offset(self, role: str) -> Array:
        """Where the frame of a wrist or prop sits on its body: T_body_role `(7,)`."""
        return self._roles.offset(role)

    def body_poses(self, role: str, seconds: float) -> Array:
        """World poses `(n, 7)` of the body behind a role, without its offset, in the newest `seconds`."""
        return compose(self._timeline.recent(role, seconds), invert(self.offset(role)))

    def place(self, role: str, offset: Array) -> None:
        """Change where a wrist or prop sits on its body, to T_body_role `(7,)`, without a jump in what is shown."""
        self._timeline.rebase(role, compose(invert(self.offset(role)), offset))
        self._roles.place(role, offset)
        wrists, objects = self.config.wrists, self.config.objects
        self.config = replace(
            self.config,
            wrists={name: replace(body, offset=offset) if name == role else body for name, body in wrists.items()},
            objects=tuple(
                replace(prop, body=replace(prop.body, offset=offset)) if prop.name == role else prop for prop in objects
            ),
        )

    def resize_hands(self, hand_scale: float) -> None:
        """Change the size of the hands, which is given relative to the model's hand."""
        self.config = replace(self.config, hand_scale=hand_scale)

    # --- the hands

    def rest(self) -> None:
        """Ease both hands to the rest pose; from there they are synthesised again."""
        for hand in self.hands.values():
            hand.resting = True

    def pause(self, on: bool = True) -> None:
        """Keep both hands as they are shown, wherever the wrists go, until the pause is switched off."""
        self.paused = on

    def plan(self, tick: Tick) -> Plan:
        """Decide what each hand shows at a tick, and collect what its synthesis needs."""
        self._tracked = frozenset(name for name, body in tick.bodies.items() if body.age_s <= HOLD_AFTER_S)
        states: dict[Side, State] = {}
        scenes: dict[Side, HandScene] = {}
        hand_states: dict[Side, HandState] = {}
        for side, hand in self.hands.items():
            wrist = tick.bodies.get(f"{side}_wrist")
            prop = None if wrist is None else choose_prop(side, wrist.pose, self.props, tick.bodies, hand.prop)
            body = None if prop is None else tick.bodies[prop.name]
            states[side] = self._state(hand, wrist, body)
            if prop is not None:
                hand.prop = prop.name
            if states[side] == "live" and wrist is not None and prop is not None and body is not None:
                other_wrist = tick.bodies.get(f"{_other(side)}_wrist")
                scenes[side] = make_scene(side, wrist, other_wrist, prop, body, self.config.hand_scale)
                hand_states[side] = hand.state
        return Plan(tick, states, scenes, hand_states)

    def show(self, plan: Plan) -> dict[Side, ShownHand]:
        """Both hands at the tick of a plan, from the steps that were synthesised for it.

        Raises `NotFiniteError`, after which `hold` can show the tick.
        """
        tick, dt_s = plan.tick, self._elapsed_s(plan.tick)
        hands: dict[Side, ShownHand] = {}
        for side, hand in self.hands.items():
            wrist = tick.bodies.get(f"{side}_wrist")
            tracked = wrist is not None and wrist.age_s <= HOLD_AFTER_S and not self.paused
            pose = wrist.pose if wrist is not None and (tracked or hand.shown is None) else None
            known = wrist is None or wrist.known
            shown = hand.show(plan.states[side], plan.steps.get(side), pose, tick.run, dt_s, known)
            if shown is not None:
                hands[side] = shown
        self._last = (tick.run, tick.index)
        return hands

    def hold(self, tick: Tick) -> dict[Side, ShownHand]:
        """Both hands as they were shown last, for a tick that failed."""
        self._last = (tick.run, tick.index)
        return {
            side: replace(hand.shown, state="hold", prop=hand.prop)
            for side, hand in self.hands.items()
            if hand.shown is not None
        }

    def recover(self) -> None:
        """Let synthesis start from what is shown, after an error."""
        for hand in self.hands.values():
            hand.recover()

    def _state(self, hand: LiveHand, wrist: BodyAtTick | None, body: BodyAtTick | None) -> State:
        if self.paused:
            return "hold"
        if hand.resting:
            hand.resting = not hand.at_rest()
            return "rest"
        ages = [np.inf if each is None else each.age_s for each in (wrist, body)]
        return state_at_age(max(ages))

    def _elapsed_s(self, tick: Tick) -> float:
        """Stream time since the last tick that was shown; one tick if the sender restarted in between."""
        if self._last is None or self._last[0] != tick.run:
            return TICK_S
        return (tick.index - self._last[1]) * TICK_S


def _limits(config: ActorConfig, bundle: Bundle) -> Array:
    """The model's limits `(A, 2)` in radians, narrowed as the actor's rig says."""
    limits = bundle.limits.copy()
    for name, ends in config.limits.items():
        angle = bundle.hand.angle_names.index(name)
        limits[angle] = np.clip(ends, *limits[angle])
    return limits


def _other(side: Side) -> Side:
    return "right" if side == "left" else "left"
