"""What one tick of an actor needs from synthesis, and what synthesis made of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from manipnet.actors.props import Prop
from manipnet.actors.transitions import HOLD_AFTER_S
from manipnet.geometry import Array, scale_positions
from manipnet.synthesis.synthesizer import HandScene, HandState, HandStep, Synthesizer
from manipnet.tracking.tick import BodyAtTick, Tick
from manipnet.wire import Side, State


@dataclass(frozen=True, slots=True)
class Plan:
    """One tick of one actor. A tick that could not be planned has no `states`; its hands stay as they are."""

    tick: Tick
    states: Mapping[Side, State] = field(default_factory=dict)
    """What each hand is to show."""
    scenes: Mapping[Side, HandScene] = field(default_factory=dict)
    """What the hands to be synthesised can sense."""
    hand_states: Mapping[Side, HandState] = field(default_factory=dict)
    """What the synthesis of each of these hands starts from."""
    steps: dict[Side, HandStep] = field(default_factory=dict)
    """The synthesised poses. `synthesise` fills them; they stay empty if synthesis fails."""


def synthesise(plans: Sequence[Plan], synthesizer: Synthesizer) -> None:
    """Fill the `steps` of all plans with one batch through the network."""
    requests: list[tuple[Plan, Side]] = [(plan, side) for plan in plans for side in plan.scenes]
    scenes = [plan.scenes[side] for plan, side in requests]
    hand_states = [plan.hand_states[side] for plan, side in requests]
    for (plan, side), step in zip(requests, synthesizer.step(scenes, hand_states), strict=True):
        plan.steps[side] = step


def make_scene(
    side: Side, wrist: BodyAtTick, other_wrist: BodyAtTick | None, prop: Prop, body: BodyAtTick, hand_scale: float
) -> HandScene:
    """What a hand at `wrist` can sense of the `prop` at `body`.

    The model's hand has one size, so for a hand that is `hand_scale` times as large everything else is made smaller.
    """
    if other_wrist is not None and other_wrist.age_s > HOLD_AFTER_S:
        other_wrist = None
    return HandScene(
        side=side,
        wrist=_shrunk(wrist.window, hand_scale),
        other_wrist=_shrunk(other_wrist.window, hand_scale) if other_wrist is not None else None,
        object=_shrunk(body.window, hand_scale),
        shape=prop.shape,
        scale=prop.scale / hand_scale,
    )


def _shrunk(window: Array, hand_scale: float) -> Array:
    return window if hand_scale == 1.0 else scale_positions(window, 1.0 / hand_scale)
