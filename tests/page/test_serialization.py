"""Between the server and its page: what goes in comes out, and nothing that could run."""

import numpy as np
import pytest

from manipnet.page.frames import Frame, HandView, PropView, ShapeView
from manipnet.page.serialization import pack, unpack
from manipnet.wire import BodyPose, HandPose, HandsMessage, Latency

IDENTITY = (0.0, 0.0, 0.0, 1.0)


def message() -> HandsMessage:
    joints = np.tile([0.1, 0.2, 0.3, *IDENTITY], (26, 1))
    hand = HandPose("live", "Mug", 1.1, np.linspace(0.0, 1.0, 20), np.tile(IDENTITY, (17, 1)), joints[0], joints)
    latency = Latency(*range(len(Latency.__dataclass_fields__)))
    return HandsMessage(
        session="s",
        actor="anna",
        seq=7,
        t_capture=1.5,
        t_publish=1.6,
        look_ahead=0.5,
        hands={"right": hand},
        bodies=(BodyPose(True, joints[0], "Mug"),),
        latency_ms=latency,
    )


def test_a_frame_arrives_as_it_was() -> None:
    rng = np.random.default_rng(1)
    view = HandView("Mug", *(rng.normal(size=shape) for shape in ((22,), (22, 3))))
    sent = Frame(
        message(),
        (PropView("Mug", "mug", "abc", 1.25, rng.normal(size=7)),),
        {"Mug": rng.normal(size=(21, 7))},
        {"right": view},
    )
    what, got = unpack(pack("frame", sent))
    assert what == "frame"
    assert (got.props[0].name, got.props[0].object, got.props[0].scale) == ("Mug", "mug", 1.25)
    np.testing.assert_array_equal(got.windows["Mug"], sent.windows["Mug"])
    for name in ("distances", "raw_positions"):
        np.testing.assert_array_equal(getattr(got.hands["right"], name), getattr(view, name))
    np.testing.assert_array_equal(got.message.hands["right"].joints, sent.message.hands["right"].joints)
    assert (got.message.actor, got.message.seq, got.message.bodies[0].name) == ("anna", 7, "Mug")


def test_a_shape_arrives_writable_and_of_its_own_kind() -> None:
    faces = np.array([[0, 1, 2]], np.int32)
    _, got = unpack(pack("shape", ShapeView("mug", "abc", np.eye(3), faces)))
    assert (got.name, got.content_hash, got.faces.dtype) == ("mug", "abc", faces.dtype)
    np.testing.assert_array_equal(got.vertices, np.eye(3))
    assert got.vertices.flags.writeable


@pytest.mark.parametrize("content", [("answer", (3, b"\x80")), ("watched", True), ("log", (30, "text"))])
def test_plain_content_passes(content: tuple) -> None:
    assert unpack(pack(*content)) == content


def test_what_is_no_part_of_the_conversation_is_not_sent() -> None:
    with pytest.raises(TypeError, match="Popen cannot be sent"):
        pack("frame", type("Popen", (), {})())
