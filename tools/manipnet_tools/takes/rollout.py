"""From a take to synthesised hands, offline, through the live timeline and the live synthesis.

Captured fingers have no way in here.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from manipnet.actors.props import Prop, choose_prop
from manipnet.geometry import SIDES, Array, Side, scale_positions
from manipnet.synthesis.model.providers import MAX_LOOK_AHEAD_S
from manipnet.synthesis.objects.shape import Shape
from manipnet.synthesis.synthesizer import HandScene, HandStep, Synthesizer
from manipnet.tracking.tick import BodyAtTick, Tick
from manipnet.tracking.timeline import Timeline
from manipnet_tools.takes.take import Take, TakeError

OTHER: dict[Side, Side] = {"left": "right", "right": "left"}


@dataclass(frozen=True)
class BodyTicks:
    """One body at `n` ticks, in the world."""

    windows: Array
    """`(n, 21, 7)` poses about the instant each tick is computed from."""
    poses: Array
    """`(n, 7)` at the tick itself."""
    ages_s: Array
    """`(n,)` since it was last tracked."""

    def __getitem__(self, ticks: slice) -> "BodyTicks":
        return BodyTicks(self.windows[ticks], self.poses[ticks], self.ages_s[ticks])

    def at(self, tick: int) -> BodyAtTick:
        """The body at one tick."""
        return BodyAtTick(self.windows[tick], self.poses[tick], float(self.ages_s[tick]))


@dataclass(frozen=True)
class Ticks:
    """What a live session sees of a take, 60 times a second: `time_s (n,)` from the take's first frame."""

    time_s: Array
    bodies: dict[str, BodyTicks]

    def __getitem__(self, ticks: slice) -> "Ticks":
        return Ticks(self.time_s[ticks], {name: body[ticks] for name, body in self.bodies.items()})


@dataclass(frozen=True)
class HandInput:
    """All that the synthesis of one hand gets at `n` ticks: windows `(n, 21, 7)` in the world, shapes and a scale.

    `held (n,)` says which of the `shapes` the hand deals with; `object` are that one's windows.
    """

    side: Side
    wrist: Array
    other_wrist: Array
    object: Array
    shapes: tuple[Shape, ...]
    held: NDArray[np.int64]
    scale: float = 1.0

    def __len__(self) -> int:
        return len(self.wrist)

    def __getitem__(self, ticks: slice) -> "HandInput":
        return replace(
            self,
            wrist=self.wrist[ticks],
            other_wrist=self.other_wrist[ticks],
            object=self.object[ticks],
            held=self.held[ticks],
        )

    def scene(self, tick: int) -> HandScene:
        """What the synthesis sees at one tick."""
        shape = self.shapes[self.held[tick]]
        return HandScene(self.side, self.wrist[tick], self.other_wrist[tick], self.object[tick], shape, self.scale)


@dataclass(frozen=True)
class HandMotion:
    """A synthesised hand in the canonical wrist frame, `n` ticks; named as in `HandState` and `HandStep`."""

    angles: Array
    positions: Array
    rotations: Array
    distances: Array
    raw_positions: Array


def tick_take(take: Take, look_ahead_s: float = MAX_LOOK_AHEAD_S) -> Ticks:
    """Stream a take into a `Timeline` and collect the ticks whose future has arrived when it ends.

    The first half second, whose past is not in the take, is left out. Raises `TakeError` when nothing remains.
    """
    timeline = Timeline(look_ahead_s)
    ticks: list[Tick] = []
    for frame, time_s in enumerate(take.time_s):
        poses = {name: track.poses[frame] if track.tracked[frame] else None for name, track in take.bodies.items()}
        timeline.push(float(time_s), poses, now_s=float(time_s))
        while (tick := timeline.poll(float(time_s))) is not None:
            ticks.append(tick)
    names = take.bodies.keys()
    whole = [t for t in ticks if t.time_s - ticks[0].time_s >= MAX_LOOK_AHEAD_S and names <= t.bodies.keys()]
    if not whole:
        raise TakeError(_too_little(take, ticks))
    return Ticks(
        np.array([t.time_s for t in whole]) - float(take.time_s[0]),
        {
            name: BodyTicks(
                np.stack([t.bodies[name].window for t in whole]),
                np.stack([t.bodies[name].pose for t in whole]),
                np.array([t.bodies[name].age_s for t in whole]),
            )
            for name in names
        },
    )


def _too_little(take: Take, ticks: Sequence[Tick]) -> str:
    if never := [name for name in take.bodies if not any(name in tick.bodies for tick in ticks)] if ticks else []:
        return f"{take.name}: {', '.join(never)} is never tracked where the others are"
    length_s = float(take.time_s[-1] - take.time_s[0])
    return f"{take.name}: is {length_s:.2f} s long; fingers need half a second before and after, so more than 1 s"


def hand_inputs(ticks: Ticks, shapes: dict[str, Shape], hand_scale: float = 1.0) -> dict[Side, HandInput]:
    """Inputs of both hands, each dealing with one of the bodies in `shapes` at a time.

    For hands of another size than the model's the scene is as the model's hand would see it: smaller for a larger one.
    """
    windows = np.stack([ticks.bodies[name].windows for name in shapes])
    inputs = {}
    for side in SIDES:
        wrist, other = (ticks.bodies[f"{name}_wrist"].windows for name in (side, OTHER[side]))
        held = _held(ticks, side, shapes)
        object_windows = windows[held, np.arange(len(held))]
        inputs[side] = HandInput(
            side,
            scale_positions(wrist, 1.0 / hand_scale),
            scale_positions(other, 1.0 / hand_scale),
            scale_positions(object_windows, 1.0 / hand_scale),
            tuple(shapes.values()),
            held,
            1.0 / hand_scale,
        )
    return inputs


def _held(ticks: Ticks, side: Side, shapes: dict[str, Shape]) -> NDArray[np.int64]:
    """Index into `shapes` of what each tick's hand deals with, `(n,)`, chosen as the server chooses."""
    props = [Prop(name, name, shape) for name, shape in shapes.items()]
    wrists, held, prop = ticks.bodies[f"{side}_wrist"].poses, [], props[0]
    for k, wrist in enumerate(wrists):
        prop = choose_prop(side, wrist, props, {p.name: ticks.bodies[p.name].at(k) for p in props}, prop.name) or prop
        held.append(props.index(prop))
    return np.array(held)


def roll_out(
    synthesizer: Synthesizer,
    hands: Sequence[HandInput],
    advance: Callable[[int], None] = lambda steps: None,
) -> list[HandMotion]:
    """Synthesise every hand from the neutral pose on, all in step so that they share network batches.

    `advance` hears how many hand-ticks each step was.
    """
    states = [synthesizer.rest_state() for _ in hands]
    steps: list[list[HandStep]] = [[] for _ in hands]
    for k in range(max(map(len, hands), default=0)):
        going = [i for i, hand in enumerate(hands) if k < len(hand)]
        results = synthesizer.step([hands[i].scene(k) for i in going], [states[i] for i in going])
        for i, result in zip(going, results, strict=True):
            states[i] = result.state
            steps[i].append(result)
        advance(len(going))
    return [_motion(of_hand) for of_hand in steps]


def _motion(steps: list[HandStep]) -> HandMotion:
    return HandMotion(
        np.stack([step.angles for step in steps]),
        np.stack([step.positions for step in steps]),
        np.stack([step.rotations for step in steps]),
        np.stack([step.distances for step in steps]),
        np.stack([step.raw_positions for step in steps]),
    )
