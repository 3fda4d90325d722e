"""One avatar of an actor: what the actor shows, carried onto the hands of a profile, tick by tick."""

from collections.abc import Mapping

import numpy as np

from manipnet.actors.actor import Actor
from manipnet.actors.transitions import ShownHand
from manipnet.geometry import SIDES
from manipnet.synthesis.carrying import HandCarrier, Held
from manipnet.synthesis.hand.avatar import AvatarHand, avatar_hand
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.tracking.tick import Tick
from manipnet.wire import HandPose, Side
from manipnet.wire.hand_names import ANGLE_NAMES


class Avatar:
    """The hands of a profile. Belongs to the tick thread after its creation."""

    def __init__(self, profile: HandProfile, model: Hand) -> None:
        """`model` is the hand that is synthesised."""
        self.profile, self._model = profile, model
        self._hands: dict[Side, AvatarHand] = {side: avatar_hand(profile.hands[side], side, model) for side in SIDES}
        self.restart()

    @property
    def guessed(self) -> list[str]:
        """What the profile did not say and was guessed."""
        return [f"radii of the {side} hand" for side, hand in self._hands.items() if hand.guessed]

    def restart(self) -> None:
        """Forget the last tick, after an error that may have spoiled it."""
        self._carriers: dict[Side, HandCarrier] = {
            side: HandCarrier(hand, self._model, side) for side, hand in self._hands.items()
        }

    def poses(self, actor: Actor, tick: Tick, shown: Mapping[Side, ShownHand]) -> dict[Side, HandPose]:
        """The avatar's hands for the hands that the actor shows at a tick."""
        return {side: self._pose(actor, side, hand, _held(actor, tick, hand)) for side, hand in shown.items()}

    def _pose(self, actor: Actor, side: Side, shown: ShownHand, held: Held | None) -> HandPose:
        carrier = self._carriers[side]
        if shown.state == "hold":
            pose = carrier.hold(shown.angles, shown.wrist)
        else:
            pose = carrier.step(shown.angles, shown.wrist, held, actor.config.hand_scale)
        angles = np.zeros(len(ANGLE_NAMES))
        angles[[ANGLE_NAMES.index(name) for name in carrier.avatar.hand.angle_names]] = pose.angles
        return HandPose(
            state=shown.state,
            object=shown.prop,
            scale=1.0,
            angles=angles,
            rotations=pose.rotations,
            wrist=pose.wrist,
            joints=pose.joints,
            wrist_shift=pose.wrist[:3] - shown.wrist[:3],
        )


def _held(actor: Actor, tick: Tick, hand: ShownHand) -> Held | None:
    """The prop that a live hand is at."""
    prop = next((prop for prop in actor.props if prop.name == hand.prop), None)
    if hand.state != "live" or prop is None or prop.name not in tick.bodies:
        return None
    return prop.shape, tick.bodies[prop.name].pose, prop.scale
