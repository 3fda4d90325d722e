"""From a take to synthesised hands, offline, through the live timeline and the live synthesis.

Captured fingers have no way in here.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from manipnet.geometry import Array
from manipnet.objects.shape import Shape
from manipnet.synthesis import HandScene, HandStep, Side, Synthesizer
from manipnet.timeline import MAX_LOOK_AHEAD_S, Tick, Timeline
from manipnet_tools.takes import Take

SIDES: tuple[Side, ...] = ("left", "right")


@dataclass(frozen=True)
class BodyTicks:
    """One body at `n` ticks, in the world."""

    windows: Array
    """`(n, 21, 7)` poses about the instant each tick is computed from."""
    poses: Array
    """`(n, 7)` at the tick itself."""

    def __getitem__(self, ticks: slice) -> "BodyTicks":
        return BodyTicks(self.windows[ticks], self.poses[ticks])


@dataclass(frozen=True)
class Ticks:
    """What a live session sees of a take, 60 times a second: `time_s (n,)` from the take's first frame."""

    time_s: Array
    bodies: dict[str, BodyTicks]

    def __getitem__(self, ticks: slice) -> "Ticks":
        return Ticks(self.time_s[ticks], {name: body[ticks] for name, body in self.bodies.items()})


@dataclass(frozen=True)
class HandInput:
    """All that the synthesis of one hand gets: windows `(n, 21, 7)` in the world, the object, its scale."""

    side: Side
    wrist: Array
    other_wrist: Array
    object: Array
    shape: Shape
    scale: float = 1.0

    def __len__(self) -> int:
        return len(self.wrist)

    def __getitem__(self, ticks: slice) -> "HandInput":
        return replace(self, wrist=self.wrist[ticks], other_wrist=self.other_wrist[ticks], object=self.object[ticks])

    def scene(self, tick: int) -> HandScene:
        """What the synthesis sees at one tick."""
        return HandScene(self.side, self.wrist[tick], self.other_wrist[tick], self.object[tick], self.shape, self.scale)


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

    The first half second, whose past is not in the take, is left out.
    """
    timeline = Timeline(look_ahead_s)
    ticks: list[Tick] = []
    for frame, time_s in enumerate(take.time_s):
        poses = {name: track.poses[frame] if track.tracked[frame] else None for name, track in take.bodies.items()}
        timeline.push(float(time_s), poses, now_s=float(time_s))
        while (tick := timeline.poll(float(time_s))) is not None:
            ticks.append(tick)
    names = take.bodies.keys()
    whole = [t for t in ticks if t.centre_s - ticks[0].time_s >= MAX_LOOK_AHEAD_S and names <= t.bodies.keys()]
    return Ticks(
        np.array([t.time_s for t in whole]) - float(take.time_s[0]),
        {
            name: BodyTicks(
                np.stack([t.bodies[name].window for t in whole]),
                np.stack([t.bodies[name].pose for t in whole]),
            )
            for name in names
        },
    )


def hand_inputs(ticks: Ticks, objects: dict[Side, str], shapes: dict[str, Shape]) -> dict[Side, HandInput]:
    """Inputs of both hands: `objects` says which body each side handles, `shapes` what each body is."""
    wrists = {side: ticks.bodies[f"{side}_wrist"].windows for side in SIDES}
    other = {"left": "right", "right": "left"}
    return {
        side: HandInput(side, wrists[side], wrists[other[side]], ticks.bodies[body].windows, shapes[body])
        for side, body in objects.items()
    }


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
        np.stack([step.state.angles for step in steps]),
        np.stack([step.state.positions for step in steps]),
        np.stack([step.state.rotations for step in steps]),
        np.stack([step.distances for step in steps]),
        np.stack([step.raw_positions for step in steps]),
    )
