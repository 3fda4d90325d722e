"""Where the camera stands: whatever happens is in the picture, however wide the window is."""

from dataclasses import replace

import numpy as np
import pytest
from test_serialization import message

from manipnet.page.frames import Frame
from manipnet.page.framing import FIELD_OF_VIEW_RAD, UP, camera_position, focus_of
from manipnet.wire import HandsMessage

BODY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def performed(lifted_m: float, apart_m: float) -> HandsMessage:
    """Both hands and a prop at a height; the hands are this far apart."""
    shown = message()
    hands = {}
    for side, sign in (("left", -1.0), ("right", 1.0)):
        away = np.array([0.5 * sign * apart_m, lifted_m, 0.0])
        hand = next(iter(shown.hands.values()))
        joints, wrist = np.tile(BODY, (len(hand.joints), 1)), BODY.copy()
        joints[:, :3] = away + np.linspace(-0.1, 0.1, len(joints))[:, None] * [0.0, 0.0, 1.0]
        wrist[:3] = away
        hands[side] = replace(hand, joints=joints, wrist=wrist)
    prop = BODY.copy()
    prop[:3] = (0.0, lifted_m + 0.1, 0.0)
    return replace(shown, hands=hands, bodies=(replace(shown.bodies[0], pose=prop),))


@pytest.mark.parametrize("aspect", [0.4, 1.0, 2.5])
@pytest.mark.parametrize(("lifted_m", "apart_m"), [(0.05, 0.5), (1.2, 0.2), (0.4, 1.0)])
def test_hands_and_props_are_in_the_picture(aspect: float, lifted_m: float, apart_m: float) -> None:
    shown = performed(lifted_m, apart_m)
    focus = focus_of([Frame(shown, (), {}, {})])
    assert focus is not None
    eye = camera_position(focus, aspect)
    ahead = (focus.center - eye) / np.linalg.norm(focus.center - eye)
    right = np.cross(ahead, UP) / np.linalg.norm(np.cross(ahead, UP))
    points = np.concatenate([*(hand.joints[:, :3] for hand in shown.hands.values()), [shown.bodies[0].pose[:3]]])
    depth, across, high = ((points - eye) @ axis for axis in (ahead, right, np.cross(right, ahead)))
    half = np.tan(0.5 * FIELD_OF_VIEW_RAD)
    assert (np.abs(high / depth) < half).all()
    assert (np.abs(across / depth) < half * aspect).all()
    assert eye[1] > focus.center[1], "it looks down"


def test_without_hands_there_is_nothing_to_frame() -> None:
    assert focus_of([Frame(replace(message(), hands={}), (), {}, {})]) is None
