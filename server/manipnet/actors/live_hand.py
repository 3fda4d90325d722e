"""One hand of an actor from tick to tick."""

from typing import Final

import numpy as np

from manipnet.actors.output_guard import OutputGuard
from manipnet.actors.transitions import PoseTransition, ShownHand
from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.synthesizer import HandStep, state_of
from manipnet.telemetry import Telemetry
from manipnet.wire import Side, State

AT_REST_RAD: Final = 0.03
"""Fingers within this angle of the rest pose count as resting."""


class LiveHand:
    """The state of one hand between ticks."""

    def __init__(self, hand: Hand, side: Side, rest_angles: Array, limits: Array, telemetry: Telemetry) -> None:
        """`hand` is the model's; `rest_angles (A,)` and `limits (A, 2)` are in radians."""
        self.side: Side = side
        self.prop: str | None = None
        """The prop to which the fingers belong, by name."""
        self.resting = False
        """Whether the hand was asked to rest: it is not synthesised until it has reached the rest pose."""
        self.state = state_of(hand, rest_angles)
        """What the next synthesis starts from."""
        self._hand, self._rest_angles = hand, rest_angles
        self._transition = PoseTransition(rest_angles, OutputGuard(limits, telemetry))

    @property
    def shown(self) -> ShownHand | None:
        """The hand as it was shown last; None before its wrist was tracked."""
        return self._transition.shown

    def show(
        self, state: State, step: HandStep | None, wrist: Array | None, run: int, dt_s: float, known: bool
    ) -> ShownHand | None:
        """Show the next tick, `dt_s` after the last one: live with a `step`, otherwise held or on its way to rest.

        The other arguments are those of `PoseTransition.show`. Raises `NotFiniteError`.
        """
        if state == "live" and step is None:
            state = "hold"
        angles = None if step is None else step.angles
        if state == "rest":
            self.prop = None
        shown = self._transition.show(state, angles, wrist, run, self.prop, dt_s, known)
        if step is not None:
            self.state = step.state
        elif state == "rest":
            self.state = state_of(self._hand, self._rest_angles)
        return shown

    def recover(self) -> None:
        """Let synthesis start from what is shown, after an error that may have spoiled the state."""
        self.state = state_of(self._hand, self._rest_angles if self.shown is None else self.shown.angles)

    def at_rest(self) -> bool:
        """Whether the fingers have reached the rest pose."""
        return self.shown is None or bool(np.abs(self.shown.angles - self._rest_angles).max() < AT_REST_RAD)
