"""OSC addresses that a rig declares, and the axes of a bridge: patterns, orders, units, angles, and what is refused."""

import math
from typing import Any

import numpy as np
import pytest
from live_server import Subscriber, serving
from osc_streams import HZ, poses, stream
from osc_writer import bundle, osc
from scipy.spatial.transform import Rotation

from manipnet.common.options import ConfigError
from manipnet.geometry import quat_to_matrix
from manipnet.inputs.osc import OscOptions
from manipnet.inputs.osc.addresses import AddressBook
from manipnet.inputs.osc.assembler import FrameAssembler
from manipnet.inputs.osc.declared import Addresses, read_pattern
from manipnet.inputs.osc.packet import split_packet
from manipnet.inputs.osc.space import ROTATION_ORDERS
from manipnet.wire.bodies import BodyFrame, BodySample

P, Q, ANGLES = (0.3, 1.1, -0.7), (0.1, -0.5, 0.7, 0.5), (20.0, -35.0, 70.0)
TO_OURS = {
    "y-up": np.eye(3),
    "z-up": np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "unity": np.diag([-1, 1, 1]),
    "z-up left": np.array([[-1, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "y z x": np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    "-z y -x": np.array([[0, 0, -1], [0, 1, 0], [-1, 0, 0]]),
    "x y -z": np.diag([1, 1, -1]),
}
"""The matrices that turn a vector in the sender's axes into one in ours."""


def frames(table: dict[str, str] | list[dict[str, str]], *datagrams: bytes) -> list[BodyFrame]:
    """The frames of datagrams that arrive together, to a receiver with these declarations."""
    tables = table if isinstance(table, list) else [table]
    assembler = FrameAssembler("osc:test", AddressBook(map(read_pattern, tables)))
    found = [frame for datagram in datagrams for frame in assembler.add(split_packet(datagram), 100.0).frames]
    return found + assembler.flush(101.0)


def the_body(table: dict[str, str] | list[dict[str, str]], *datagrams: bytes) -> BodySample:
    ((body,),) = [frame.bodies for frame in frames(table, *datagrams)]
    return body


def is_pose(body: BodySample, p: Any, rotation: np.ndarray) -> None:
    """Check a pose against a position and a rotation matrix."""
    np.testing.assert_allclose(body.p, p, atol=1e-6)
    np.testing.assert_allclose(quat_to_matrix(np.array(body.q)), rotation, atol=1e-6)


@pytest.mark.parametrize("axes", TO_OURS)
def test_axes(axes: str) -> None:
    table = {"address": "/stage/<body>", "arguments": "x y z qx qy qz qw", "axes": axes}
    ours = TO_OURS[axes]
    is_pose(the_body(table, osc("/stage/Box", *P, *Q)), ours @ P, ours @ Rotation.from_quat(Q).as_matrix() @ ours.T)


@pytest.mark.parametrize("order", ROTATION_ORDERS)
@pytest.mark.parametrize("axes", ["y-up", "z-up", "unity", "z-up left", "y z x"])
@pytest.mark.parametrize("angles", ["degrees", "radians"])
def test_euler_angles_turn_about_fixed_axes_in_the_declared_order(order: str, axes: str, angles: str) -> None:
    table = {"address": "/t/<body>", "arguments": "x y z rx ry rz", "axes": axes, "angles": angles}
    sent = np.radians(ANGLES) if angles == "radians" else ANGLES
    body = the_body(table | {"rotation_order": order}, osc("/t/Box", *P, *map(float, sent)))
    turns = [ANGLES["xyz".index(axis)] for axis in order]
    ours = TO_OURS[axes]
    is_pose(body, ours @ P, ours @ Rotation.from_euler(order, turns, degrees=True).as_matrix() @ ours.T)


@pytest.mark.parametrize(("unit", "size"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("in", 0.0254)])
def test_units(unit: str, size: float) -> None:
    table = {"address": "/t/<body>", "arguments": "x y z qx qy qz qw", "unit": unit}
    is_pose(the_body(table, osc("/t/Box", *P, *Q)), size * np.array(P), Rotation.from_quat(Q).as_matrix())


PARTS = ("x", "y", "z", "qx", "qy", "qz", "qw")
x, y, z, qx, qy, qz, qw = *P, *Q


@pytest.mark.parametrize(
    ("table", "datagrams", "key"),
    [
        ({"address": "/t/<body>/pose", "arguments": "qw qx qy qz x y z"}, [osc("/t/7/pose", qw, qx, qy, qz, *P)], 7),
        ({"address": "/t", "arguments": "body x y z qx qy qz qw"}, [osc("/t", "Box", *P, *Q)], "Box"),
        ({"address": "/t", "arguments": "x y z body qx qy qz qw"}, [osc("/t", *P, 7, *Q)], 7),
        ({"address": "/t", "arguments": "x y z qx qy qz qw", "body": "Box"}, [osc("/t", *P, *Q)], "Box"),
        ({"address": "/t", "arguments": "x y z qx qy qz qw", "body": "7"}, [osc("/t", *P, *Q)], 7),
        ({"address": "/t/<body>", "arguments": "- x - y z qx qy qz qw -"}, [osc("/t/7", 1, x, "a", y, z, *Q, 2.0)], 7),
        ({"address": "/t", "arguments": "=pose body x y z qx qy qz qw"}, [osc("/t", "pose", 7, *P, *Q)], 7),
        ({"address": "/t", "arguments": "=3 body x y z qx qy qz qw"}, [osc("/t", 3, 7, *P, *Q)], 7),
        (
            {"address": "/<skeleton>/<bone>", "arguments": "x y z qx qy qz qw"},
            [osc("/Ann/LHand", *P, *Q)],
            "Ann:LHand",
        ),
        (
            [
                {"address": "/t/<body>/pos", "arguments": "x y z"},
                {"address": "/t/<body>/rot", "arguments": "qw qx qy qz"},
            ],
            [osc("/t/7/pos", *P), osc("/t/7/rot", qw, qx, qy, qz)],
            7,
        ),
        (
            [{"address": f"/t/<body>/{part}", "arguments": part} for part in PARTS],
            [osc(f"/t/7/{part}", value) for part, value in zip(PARTS, (*P, *Q), strict=True)],
            7,
        ),
        (
            [
                {"address": "/t/<body>/xy", "arguments": "x y"},
                {"address": "/t/<body>/rest", "arguments": "z qx qy qz qw"},
            ],
            [osc("/t/7/xy", x, y), osc("/t/7/rest", z, *Q)],
            7,
        ),
    ],
)
def test_forms(table, datagrams: list[bytes], key: int | str) -> None:
    for way in datagrams, [bundle(*datagrams)] if len(datagrams) > 1 else datagrams:
        body = the_body(table, *way)
        assert (body.name if isinstance(key, str) else body.id) == key
        is_pose(body, P, Rotation.from_quat(Q).as_matrix())


def test_components_of_other_axes_and_angles_come_one_by_one() -> None:
    about = {"axes": "z-up left", "unit": "cm", "rotation_order": "yxz"}
    names = ("x", "y", "z", "rx", "ry", "rz")
    tables = [{"address": f"/t/<body>/{name}", "arguments": name} | about for name in names]
    sent = [osc(f"/t/Box/{name}", value) for name, value in zip(names, (*P, *ANGLES), strict=True)]
    ours = TO_OURS["z-up left"]
    turn = Rotation.from_euler("yxz", [ANGLES[1], ANGLES[0], ANGLES[2]], degrees=True).as_matrix()
    is_pose(the_body(tables, bundle(*sent)), 0.01 * ours @ P, ours @ turn @ ours.T)


def test_a_body_is_declared_lost_and_times_are_declared() -> None:
    tables = [
        {"address": "/t/<body>", "arguments": "tracked x y z qx qy qz qw"},
        {"address": "/clock", "arguments": "s"},
    ]
    found = [
        frames(tables, bundle(osc("/clock", 12.5), osc("/t/7", tracked, *P, *Q))) for tracked in (1, 0, True, False)
    ]
    assert [frame.bodies[0].tracked for (frame,) in found] == [True, False, True, False]
    assert found[0][0].t_s == 12.5
    ((frame,),) = [
        frames(
            [*tables[:1], {"address": "/clock", "arguments": "ms"}],
            bundle(osc("/clock", 2500.0), osc("/t/7", 1, *P, *Q)),
        )
    ]
    assert frame.t_s == 2.5


def test_a_declaration_comes_before_an_address_that_is_always_understood() -> None:
    table = {"address": "/rigidbody/<body>/transformation", "arguments": "qw qx qy qz x y z"}
    is_pose(
        the_body(table, osc("/rigidbody/7/transformation", qw, qx, qy, qz, *P)), P, Rotation.from_quat(Q).as_matrix()
    )


POSE = {"address": "/t/<body>", "arguments": "x y z qx qy qz qw"}


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"adress": "/t"}, "has the key 'adress'; allowed are address, arguments"),
        ({"unit": 1}, "has unit = 1; it must be text"),
        ({"address": "t/<body>"}, "it must begin with '/'"),
        ({"address": "/t/*"}, "it must begin with '/' and have no spaces or"),
        ({"arguments": ""}, "does not say which arguments /t/<body> has"),
        ({"arguments": "x y z w"}, "has the argument 'w' for /t/<body>; allowed are body"),
        ({"arguments": "x y x"}, "has the argument x twice for /t/<body>"),
        ({"arguments": "body - -"}, "gives no position, rotation or time for /t/<body>"),
        ({"address": "/t"}, "does not say which body /t is about"),
        ({"address": "/<body>/<body>"}, "says more than once which body /<body>/<body> is about"),
        ({"arguments": "body x y z"}, "says more than once which body /t/<body> is about"),
        ({"body": "Box"}, "says more than once which body /t/<body> is about"),
        ({"address": "/<body>/<skeleton>/<bone>"}, "names both a body and a bone of a skeleton"),
        ({"address": "/t/<bone>"}, "names a bone for /t/<bone>, but no skeleton"),
        ({"axes": "x y"}, "has wrong axes for /t/<body>: axes are 'x y'; they must be y-up, z-up, unity"),
        ({"axes": "x y y"}, "they must be y-up, z-up, unity"),
        ({"unit": "furlong"}, "has the unit 'furlong' for /t/<body>; allowed are"),
        ({"angles": "turns"}, "has angles = 'turns' for /t/<body>; allowed are degrees, radians"),
        ({"arguments": "rx ry rz"}, "needs rotation_order for the angles of /t/<body>"),
        ({"arguments": "rz", "rotation_order": ""}, "needs rotation_order for the angles of /t/<body>"),
        ({"rotation_order": "xyx"}, "has rotation_order = 'xyx' for /t/<body>; allowed are xyz, xzy, yxz"),
    ],
)
def test_a_wrong_declaration_is_refused_with_what_is_allowed(changes: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ConfigError) as error:
        read_pattern(POSE | changes)
    assert complaint in str(error.value)


def test_an_address_that_is_declared_twice_is_refused() -> None:
    with pytest.raises(ConfigError, match="declares /t/<body> twice"):
        Addresses().read([POSE, POSE | {"axes": "z-up"}], None)  # type: ignore[arg-type]


def test_declarations_survive_writing_and_the_command_line() -> None:
    full = POSE | {
        "address": "/t",
        "axes": "z-up left",
        "unit": "cm",
        "angles": "radians",
        "rotation_order": "yzx",
        "body": "Box",
    }
    (pattern,) = Addresses().read([full], None)  # type: ignore[arg-type]
    assert Addresses().read(Addresses().write((pattern,)), None) == (pattern,)  # type: ignore[arg-type]
    text = "{ " + ", ".join(f"{key} = '{value}'" for key, value in full.items()) + " }"
    assert Addresses().parse([text]) == (pattern,)


@pytest.mark.parametrize(
    ("up", "left_handed", "axes"),
    [("y", False, "y-up"), ("z", False, "z-up"), ("y", True, "unity"), ("z", True, "z-up left")],
)
@pytest.mark.parametrize("way", ["transformation", "parts", "argument", "sparck", "bone"])
def test_the_axes_of_a_bridge(up, left_handed: bool, axes: str, way: str) -> None:
    datagrams = {
        "transformation": [osc("/rigidbody/7/transformation", *P, *Q)],
        "parts": [osc("/rigidbody/7/position", *P), osc("/rigidbody/7/quat", *Q)],
        "argument": [osc("/rigidbody", 7, "position", *P), osc("/rigidbody", 7, "quat", *Q)],
        "sparck": [osc("/rb", 7, 2, 1000, *P, *Q)],
        "bone": [osc("/skeleton/Ann/bone/9/transformation", *P, *Q)],
    }[way]
    assert OscOptions(osc_up=up, osc_left_handed=left_handed).bridge_axes == axes
    assembler = FrameAssembler("osc:test", AddressBook((), axes))
    for datagram in datagrams:
        assembler.add(split_packet(datagram), 100.0)
    ((body,),) = [frame.bodies for frame in assembler.flush(101.0)]
    ours = TO_OURS[axes]
    is_pose(body, ours @ P, ours @ Rotation.from_quat(Q).as_matrix() @ ours.T)


def test_the_axes_of_a_bridge_do_not_touch_other_senders() -> None:
    assembler = FrameAssembler("osc:test", AddressBook((), "z-up left"))
    assembler.add(split_packet(osc("/VMC/Ext/Tra/Pos", "7", *P, *Q)), 100.0)
    ((body,),) = [frame.bodies for frame in assembler.flush(101.0)]
    ours = TO_OURS["unity"]
    is_pose(body, ours @ P, ours @ Rotation.from_quat(Q).as_matrix() @ ours.T)


RIG = """
[bodies]
left_wrist = 1
right_wrist = "glove/right"
[[objects]]
body = "Box"
mesh = "cube"
[server]
look_ahead = 0.1
osc_up = "z"
osc_left_handed = true
[[server.osc_address]]
address = "/glove"
arguments = "=pose body rz ry rx x y z"
axes = "z-up"
unit = "mm"
angles = "radians"
rotation_order = "xyz"
[[server.osc_address]]
address = "/prop/position"
arguments = "- z y x"
body = "Box"
axes = "x y -z"
[[server.osc_address]]
address = "/prop/rotation"
arguments = "ry rx rz"
body = "Box"
axes = "x y -z"
rotation_order = "yxz"
"""


def test_a_server_understands_what_its_rig_declares(tiny_bundle, tmp_path) -> None:
    """A wrist of a left-handed bridge with Z up, and a wrist and a prop of other senders, at known places."""
    rig = tmp_path / "rig.toml"
    rig.write_text(RIG)
    right, prop = (
        Rotation.from_euler("xyz", (0.4, -0.9, 1.7)),
        Rotation.from_euler("yxz", [ANGLES[1], ANGLES[0], ANGLES[2]], degrees=True),
    )

    def frame(k: int) -> list[bytes]:
        noise = 1e-5 * math.sin(37.0 * k)
        left_z_up = (-poses(0)[0][0], -poses(0)[0][2], poses(0)[0][1] + noise)
        return [
            bundle(
                osc("/frame/timestamp", 1e3 * k / HZ),
                osc("/rigidbody/1/transformation", *left_z_up, *Q),
                osc("/glove", "pose", "glove/right", 1.7, -0.9, 0.4, 150.0, -20.0, 1e3 * (1.0 + noise)),
                osc("/prop/position", 0.0, -0.04, 1.0 + noise, 0.02),
                osc("/prop/rotation", ANGLES[1], ANGLES[0], ANGLES[2]),
            )
        ]

    with serving("--rig", str(rig), "--model", str(tiny_bundle)) as server:
        subscriber = Subscriber(server.addresses["hands"])
        stream(int(server.addresses["osc"].rpartition(":")[2]), frame, 1.0)
        message = subscriber.until(0.5)[-1]
        subscriber.close()
    bodies = {body.name: body.pose for body in message.bodies}
    expected = {
        "left_wrist": (poses(0)[0][:3], TO_OURS["z-up left"], Rotation.from_quat(Q)),
        "right_wrist": ((0.15, 1.0, 0.02), TO_OURS["z-up"], right),
        "Box": ((0.02, 1.0, 0.04), TO_OURS["x y -z"], prop),
    }
    for name, (p, ours, turn) in expected.items():
        np.testing.assert_allclose(bodies[name][:3], p, atol=1e-4)
        np.testing.assert_allclose(quat_to_matrix(bodies[name][3:]), ours @ turn.as_matrix() @ ours.T, atol=1e-4)
