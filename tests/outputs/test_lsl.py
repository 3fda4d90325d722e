"""Lab Streaming Layer: the streams of an actor, read back by its own inlet."""

from dataclasses import replace

import numpy as np
import pytest
from make_vectors import messages

from manipnet.outputs.declaration import EncodedHands
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES

try:
    import pylsl
except (ImportError, OSError, RuntimeError) as error:
    pytest.skip(f"needs pylsl with its library liblsl: {error}", allow_module_level=True)

from manipnet.outputs.lsl.sender import LslSender

PATIENCE_S = 20.0
LIVE = messages()["live"]


def inlet(name):
    """An inlet of the stream with this name, once it has been found."""
    (found,) = pylsl.resolve_byprop("name", name, timeout=PATIENCE_S)
    made = pylsl.StreamInlet(found)
    made.open_stream(timeout=PATIENCE_S)
    return made


def pulled(made):
    """The next sample and its time."""
    sample, at_s = made.pull_sample(PATIENCE_S)
    assert sample is not None, "nothing has arrived"
    return list(sample), at_s


def labels(made):
    channel = made.info(PATIENCE_S).desc().child("channels").child("channel")
    out = []
    while not channel.empty():
        out.append(channel.child_value("label"))
        channel = channel.next_sibling()
    return out


@pytest.fixture
def sender():
    sender = LslSender()
    yield sender
    sender.close()


def test_hands_bodies_and_events_are_read_back(sender):
    actor = "reader-of-streams"
    message = replace(LIVE, actor=actor, session="lsl")
    sender.send(EncodedHands(message))
    hands, bodies, events = (inlet(f"ManipNet {actor} {what}") for what in ("hands", "bodies", "events"))
    one_handed = replace(message, hands={"right": LIVE.hands["right"]})
    before_s = pylsl.local_clock()
    assert sender.send(EncodedHands(one_handed))
    after_s = pylsl.local_clock()

    sample, at_s = pulled(hands)
    assert len(sample) == len(labels(hands)) == 2 * 26 * 7
    assert labels(hands)[7 * 26] == f"right_{OPENXR_JOINT_NAMES[0]}_px"
    assert np.isnan(sample[: 26 * 7]).all()
    np.testing.assert_allclose(sample[26 * 7 :], LIVE.hands["right"].joints.ravel(), atol=1e-6)
    latency_s = LIVE.latency_ms.total / 1e3
    assert before_s - latency_s - 1e-3 <= at_s <= after_s - latency_s + 1e-3

    sample, _ = pulled(bodies)
    assert labels(bodies)[::7] == [f"{body.name}_px" for body in LIVE.bodies]
    assert np.isnan(sample[-7:]).all(), "the mug is not tracked"
    np.testing.assert_allclose(sample[:7], LIVE.bodies[0].pose, atol=1e-6)

    assert pulled(events)[0] == ["left absent"]


def test_other_bodies_begin_another_stream(sender):
    message = replace(LIVE, actor="other-bodies")
    sender.send(EncodedHands(message))
    assert len(labels(inlet("ManipNet other-bodies bodies"))) == 21
    sender.send(EncodedHands(replace(message, bodies=LIVE.bodies[:1])))
    assert len(labels(inlet("ManipNet other-bodies bodies"))) == 7
