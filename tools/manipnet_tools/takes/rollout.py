"""From a take to synthesised hands, offline, through the live timeline and the live synthesis.

Captured fingers are not used.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from manipnet.actors.props import Prop, choose_prop
from manipnet.geometry import SIDES, Array, Side, scale_positions
from manipnet.synthesis.carrying import Held
from manipnet.synthesis.model.providers import MAX_LOOK_AHEAD_S
from manipnet.synthesis.objects.shape import Shape
from manipnet.synthesis.synthesizer import HandScene, HandStep, Synthesizer
from manipnet.tracking.tick import BodyAtTick, Tick
from manipnet.tracking.timeline import Timeline
from manipnet_tools.takes.take import Take, TakeError
from manipnet_tools.takes.timecode_track import TimecodeTrack

_log = logging.getLogger(__name__)
OTHER: dict[Side, Side] = {"left": "right", "right": "left"}


@dataclass(frozen=True)
class BodyTicks:
    """One body at `n` ticks, in the world."""

    windows: Array
    """`(n, 21, 7)` poses about the instant from which each tick is computed."""
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
    """A take as a live session sees it, 60 times a second; `time_s (n,)` starts at the take's first frame."""

    time_s: Array
    bodies: dict[str, BodyTicks]
    timecode: TimecodeTrack | None = None

    def __getitem__(self, ticks: slice) -> "Ticks":
        timecode = None if self.timecode is None else self.timecode[ticks]
        return Ticks(self.time_s[ticks], {name: body[ticks] for name, body in self.bodies.items()}, timecode)


@dataclass(frozen=True)
class HandInput:
    """The whole input of the synthesis of one hand at `n` ticks: windows `(n, 21, 7)` in the world, shapes and a scale.

    `held (n,)` is the index of the shape that the hand handles, and `object` are the windows of that one.
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
        """The scene at one tick."""
        shape = self.shapes[self.held[tick]]
        return HandScene(self.side, self.wrist[tick], self.other_wrist[tick], self.object[tick], shape, self.scale)


@dataclass(frozen=True)
class HandMotion:
    """A synthesised hand at `n` ticks in the canonical wrist frame; the fields are those of `HandStep`."""

    angles: Array
    positions: Array
    rotations: Array
    distances: Array
    raw_positions: Array


def tick_take(take: Take, look_ahead_s: float = MAX_LOOK_AHEAD_S) -> Ticks:
    """Stream a take into a `Timeline` and collect the ticks that fall due before it ends.

    The first half second is left out, because its past is not in the take. An object that is never tracked is left out
    too, and reported. Raises `TakeError` if nothing remains.
    """
    take = _without_lost_objects(take)
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
    time_s = np.array([t.time_s for t in whole])
    return Ticks(
        time_s - float(take.time_s[0]),
        {
            name: BodyTicks(
                np.stack([t.bodies[name].window for t in whole]),
                np.stack([t.bodies[name].pose for t in whole]),
                np.array([t.bodies[name].age_s for t in whole]),
            )
            for name in names
        },
        None if take.timecode is None else take.timecode.at(take.time_s, time_s),
    )


def _without_lost_objects(take: Take) -> Take:
    lost = [name for name in take.objects if not take.bodies[name].tracked.any()]
    if not lost:
        return take
    _log.warning("%s: these bodies are left out because they are never tracked: %s", take.name, ", ".join(lost))
    return replace(take, bodies={name: track for name, track in take.bodies.items() if name not in lost})


def _too_little(take: Take, ticks: Sequence[Tick]) -> str:
    if never := [name for name in take.bodies if not any(name in tick.bodies for tick in ticks)] if ticks else []:
        return f"{take.name}: {', '.join(never)} is never tracked while the other bodies are"
    length_s = float(take.time_s[-1] - take.time_s[0])
    wanted = "it must be longer than 1 s, which leaves half a second before and after a tick"
    return f"{take.name}: is {length_s:.2f} s long; {wanted}"


def hand_inputs(ticks: Ticks, shapes: dict[str, Shape], hand_scale: float = 1.0) -> dict[Side, HandInput]:
    """Inputs of both hands, each of which handles one of the bodies in `shapes` at a time.

    The model's hand has one size, so for hands that are `hand_scale` times as large everything else is made smaller.
    """
    if lost := [name for name in shapes if name not in ticks.bodies]:
        raise TakeError(f"{lost[0]} has a mesh but is never tracked in the take")
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


def held_objects(ticks: Ticks, shapes: dict[str, Shape], hand: HandInput) -> list[Held]:
    """The object that a hand handles at each tick, with its pose in the world."""
    names = list(shapes)
    return [(shapes[names[k]], ticks.bodies[names[k]].poses[tick], 1.0) for tick, k in enumerate(hand.held)]


def _held(ticks: Ticks, side: Side, shapes: dict[str, Shape]) -> NDArray[np.int64]:
    """Index of the shape that the hand handles at each tick, `(n,)`, chosen as the server chooses it."""
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
    """Synthesise every hand from the neutral pose on, all in step, so that they share network batches.

    `advance` is called with the number of hand-ticks of each step.
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
