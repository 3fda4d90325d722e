"""Streams of Lab Streaming Layer (LSL): for each actor its hands, its bodies and its events.

Samples are stamped with the instant that they show, on LSL's own clock, so that a recording lines up with those of
other devices. Source: the documentation of liblsl and the metadata conventions of XDF for motion capture.
"""

from collections.abc import Sequence

import numpy as np
from pylsl import StreamInfo, StreamOutlet, cf_float32, cf_string, local_clock

from manipnet.outputs.declaration import EncodedHands, HandsOutput
from manipnet.wire import SIDES, HandsMessage
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES

RATE_HZ = 60.0
_POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
_NOTHING = np.full(len(OPENXR_JOINT_NAMES) * len(_POSE), np.nan)


class LslSender(HandsOutput):
    """Offers the streams of every actor, each from the actor's first message on."""

    def __init__(self) -> None:
        self._actors: dict[str, _ActorStreams] = {}

    def send(self, hands: EncodedHands) -> bool:
        """Push one sample to the streams of the actor; False if nobody receives any of them."""
        message = hands.message
        if message.actor not in self._actors:
            self._actors[message.actor] = _ActorStreams(message)
        return self._actors[message.actor].push(message)

    def close(self) -> None:
        """End the streams."""
        self._actors.clear()


class _ActorStreams:
    """The streams of one actor."""

    def __init__(self, message: HandsMessage) -> None:
        self._name = f"ManipNet {message.actor}"
        joints = [f"{side}_{joint}" for side in SIDES for joint in OPENXR_JOINT_NAMES]
        self._hands = _pose_outlet(f"{self._name} hands", message.session, joints)
        self._events = StreamOutlet(_info(f"{self._name} events", "Markers", 1, 0.0, cf_string, message.session))
        self._bodies: StreamOutlet | None = None
        self._body_names: tuple[str, ...] = ()
        self._shown: dict[str, str] = {}

    def push(self, message: HandsMessage) -> bool:
        """Push the poses, and an event for each hand whose state or object has changed."""
        at_s = local_clock() - 1e-3 * message.latency_ms.total
        joints = [message.hands[side].joints.ravel() if side in message.hands else _NOTHING for side in SIDES]
        self._hands.push_sample(np.concatenate(joints).tolist(), at_s)
        self._push_bodies(message, at_s)
        for side in SIDES:
            hand = message.hands.get(side)
            shown = f"{side} absent" if hand is None else f"{side} {hand.state} {hand.object or '-'}"
            if shown != self._shown.get(side):
                self._shown[side] = shown
                self._events.push_sample([shown], at_s)
        outlets = (self._hands, self._events, self._bodies)
        return any(outlet.have_consumers() for outlet in outlets if outlet is not None)

    def _push_bodies(self, message: HandsMessage, at_s: float) -> None:
        """Push the poses of the bodies; a stream has fixed channels, so other bodies begin another stream."""
        names = tuple(body.name for body in message.bodies)
        if names != self._body_names:
            self._body_names = names
            self._bodies = _pose_outlet(f"{self._name} bodies", message.session, names) if names else None
        if self._bodies is not None:
            poses = [body.pose if body.tracked else np.full(len(_POSE), np.nan) for body in message.bodies]
            self._bodies.push_sample(np.concatenate(poses).tolist(), at_s)


def _pose_outlet(name: str, session: str, places: Sequence[str]) -> StreamOutlet:
    """A stream with a position and a quaternion for each of the `places`, which name its channels."""
    labels = [f"{place}_{part}" for place in places for part in _POSE]
    info = _info(name, "MoCap", len(labels), RATE_HZ, cf_float32, session)
    setup = info.desc().append_child("setup")
    setup.append_child_value("axes", "right-handed, Y up")
    channels = info.desc().append_child("channels")
    for label in labels:
        channel = channels.append_child("channel")
        is_position = label[-2] == "p"
        channel.append_child_value("label", label)
        channel.append_child_value("type", ("Position" if is_position else "Orientation") + label[-1].upper())
        channel.append_child_value("unit", "meters" if is_position else "quaternion")
    return StreamOutlet(info)


def _info(name: str, kind: str, channels: int, rate_hz: float, form: int, session: str) -> StreamInfo:
    return StreamInfo(name, kind, channels, rate_hz, form, f"{name} {session}")
