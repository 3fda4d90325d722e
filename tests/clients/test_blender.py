"""The packaged Blender extension on a fake `bpy`: live on an armature and as empties, keyframes, a clean exit."""

import importlib
import sys
import threading
import time
import tomllib
import zipfile
from types import SimpleNamespace

import numpy as np
import pytest
from blender import package
from checkout import ROOT, publishing
from joint_poses import assert_joints
from manipnet_client import decode
from manipnet_client.retarget import BONES
from random_hand import ENDS, HAND, posed

from manipnet import __version__
from manipnet.geometry import quat_conjugate, quat_exp, quat_multiply, quat_rotate, quat_to_matrix
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.wire import encode_binary

FAKE = ("bpy", "mathutils", "manipnet_live")


@pytest.fixture(scope="module")
def packaged(tmp_path_factory):
    """The folder that holds the extension as packaging writes it."""
    return package.write_unpacked(tmp_path_factory.mktemp("extensions")).parent


@pytest.fixture
def blender(packaged, monkeypatch):
    """The extension, registered in a fresh fake Blender."""
    monkeypatch.syspath_prepend(str(ROOT / "tests" / "clients" / "fake_blender"))
    monkeypatch.syspath_prepend(str(packaged))
    extension = importlib.import_module("manipnet_live")
    extension.register()
    yield SimpleNamespace(extension=extension, session=extension.session, bpy=sys.modules["bpy"])
    extension.unregister()
    for name in [n for n in sys.modules if n.partition(".")[0] in FAKE]:
        del sys.modules[name]


def pose_of(position, rotation):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = quat_to_matrix(rotation), position
    return matrix


def armature(bpy, rng):
    """Both hands in a T-pose, with Mixamo's bone names and randomly rotated hand and finger bones."""
    positions, _ = forward_kinematics(HAND, np.zeros(20))
    bones = []
    for side, sign in (("Left", -1.0), ("Right", 1.0)):
        joints, turn = positions * [sign, 1, 1] + [sign, 0, 0], quat_exp(rng.normal(size=3))
        joints = quat_rotate(turn, joints)
        hand = SimpleNamespace(
            name=f"mixamorig:{side}Hand", matrix_local=pose_of(joints[0], quat_exp(rng.normal(size=3))), parent=None
        )
        hand.head_local = joints[0]
        bones.append(hand)
        for i in range(15):
            finger, part = ("Thumb", "Index", "Middle", "Ring", "Pinky")[i // 3], i % 3 + 1
            bone = SimpleNamespace(name=f"mixamorig:{side}Hand{finger}{part}", parent=hand if part == 1 else bones[-1])
            bone.matrix_local = pose_of(joints[BONES[i]], quat_exp(rng.normal(size=3)))
            bone.head_local, bone.tail_local = joints[BONES[i]], joints[ENDS[i]]
            bones.append(bone)
    thing = bpy.types.Object("Rig", SimpleNamespace(bones=bones))
    thing.pose = SimpleNamespace(
        bones={
            b.name: SimpleNamespace(rotation_quaternion=(1.0, 0, 0, 0), location=(0.0, 0, 0), matrix=None)
            for b in bones
        }
    )
    return thing


def quat_of(matrix):
    w, x, y, z = sys.modules["mathutils"].Matrix(matrix).to_quaternion()
    return np.array([x, y, z, w])


def posed_rotations(thing, side):
    """The finger bones of a side and their posed rotations `(15, 4)` by Blender's rule.

    A bone's pose is its parent's pose, times its rest pose relative to its parent's, times its own rotation.
    """
    world = {}
    for bone in thing.data.bones:
        rest = quat_of(bone.matrix_local)
        if bone.parent is None:
            world[bone.name] = rest
            continue
        w, x, y, z = thing.pose.bones[bone.name].rotation_quaternion
        local = quat_multiply(quat_conjugate(quat_of(bone.parent.matrix_local)), rest)
        carried = quat_multiply(world[bone.parent.name], local)
        world[bone.name] = quat_multiply(carried, np.array([x, y, z, w]))
    fingers = [bone for bone in thing.data.bones if bone.parent and side.capitalize() in bone.name]
    return fingers, np.array([world[bone.name] for bone in fingers])


@pytest.mark.parametrize("side", ["left", "right"])
def test_bones_point_where_the_hand_does(blender, side):
    rng = np.random.default_rng(3)
    thing = armature(blender.bpy, rng)
    message, along = posed(side, rng)
    rig = importlib.import_module("manipnet_live.rig")
    rig.ArmatureHand(thing, side, follow_wrist=False).show(decode(encode_binary(message)).hand(side), 1.0)
    bones, turned = posed_rotations(thing, side)
    rest = np.array([quat_of(bone.matrix_local) for bone in bones])
    bind = np.array([bone.tail_local - bone.head_local for bone in bones])
    shown = quat_rotate(quat_multiply(turned, quat_conjugate(rest)), bind)
    shown /= np.linalg.norm(shown, axis=1, keepdims=True)
    # The rotation of the hand itself is unknown here, so the angles between all pairs of bones are compared.
    np.testing.assert_allclose(shown @ shown.T, along @ along.T, atol=1e-5)


def test_an_armature_without_fingers_is_refused_by_name(blender):
    rig = importlib.import_module("manipnet_live.rig")
    thing = blender.bpy.types.Object("Rig", SimpleNamespace(bones=[]))
    with pytest.raises(rig.RigError, match="no bone for Hand, ThumbProximal"):
        rig.ArmatureHand(thing, "left", follow_wrist=False)


def show_until(blender, condition, limit_s=20.0):
    give_up = time.monotonic() + limit_s
    while not condition():
        blender.bpy.app.timers.run()
        assert time.monotonic() < give_up
        time.sleep(0.005)


def test_a_live_session_is_recorded_and_leaves_nothing_behind(blender):
    threads = threading.active_count()
    thing = armature(blender.bpy, np.random.default_rng(4))
    session = blender.session
    with publishing() as (_, tcp, _):
        session.start(tcp, "", 0.05, thing, True)
        show_until(blender, lambda: session.stats().received > 5 and thing.pose.bones["mixamorig:LeftHand"].matrix)
        session.start_recording()
        show_until(blender, lambda: len(session._recording) > 40)
        frames = session.stop_recording()
        session.stop()
    assert threading.active_count() == threads
    assert not blender.bpy.app.timers.registered
    curves = thing.animation_data.action.curves
    assert len(curves) == 2 * (16 * 4 + 3)  # rotations of fingers and wrists, locations of wrists
    assert thing.animation_data.action_slot == ("OBJECT", "Rig")
    assert frames > 5
    for curve in curves.values():
        assert curve.points[::2].tolist() == list(range(10, 10 + frames))
        assert curve.updated
    lengths = sum(
        curves['pose.bones["mixamorig:LeftHandIndex1"].rotation_quaternion', i].points[1::2] ** 2 for i in range(4)
    )
    np.testing.assert_allclose(lengths, 1.0, atol=1e-6)


def test_actions_without_slots(blender):
    blender.bpy.action_type = blender.bpy.PlainAction
    recording = importlib.import_module("manipnet_live.recording")
    thing = armature(blender.bpy, np.random.default_rng(5))
    taken = recording.Recording(thing, ["mixamorig:LeftHandIndex1"], ["mixamorig:LeftHand"])
    for t in (0.0, 0.1, 0.1, 0.3):
        turn = np.array([[np.cos(t), np.sin(t), 0.0, 0.0]]) * (-1 if t == 0.1 else 1)
        taken.add(t, turn, np.array([[2 * t, 0.0, 1.0]]))
    assert taken.write(1, 10.0) == 4
    w, x, _, _, px, _, pz = (c.points[1::2] for c in thing.animation_data.action.fcurves.values())
    np.testing.assert_allclose(np.arctan2(x, w), [0.0, 0.1, 0.2, 0.3], atol=2e-3)
    np.testing.assert_allclose([px, pz], [[0.0, 0.2, 0.4, 0.6], [1.0] * 4], atol=1e-9)


def test_empties_follow_the_joints(blender):
    session, objects = blender.session, blender.bpy.data.objects
    with publishing() as (_, tcp, _):
        session.start(tcp, "", 0.05, None, False)
        show_until(blender, lambda: session.stats().received > 5 and objects.get("manipnet_left_wrist").location[0])
        x, y, z = objects.get("manipnet_left_index_tip").location
        assert x != 0
        assert (y, z) == (0, 0)
        assert not session.can_record
    session.stop()


def test_axes_keep_joint_angles(blender):
    axes = importlib.import_module("manipnet_live.axes")
    assert_joints("blender", axes.to_blender)
    up = quat_rotate(axes.turned_to_blender(np.array([0.0, 0.0, 0.0, 1.0])), np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(up, [0, 0, 1], atol=1e-12)


def test_a_wrong_address_is_reported(blender):
    panel = importlib.import_module("manipnet_live.panel")
    reports = []
    operator = panel.MANIPNET_OT_connect()
    operator.report = lambda kind, text: reports.append((kind, text))
    chosen = SimpleNamespace(address="nowhere", actor="", delay=0.1, armature=None, follow_wrists=False)
    assert operator.execute(SimpleNamespace(scene=SimpleNamespace(manipnet=chosen))) == {"CANCELLED"}
    assert "tcp://HOST:PORT" in reports[0][1]
    assert not blender.session.is_running


def test_the_panel_shows_state_rate_and_losses(blender):
    panel, drawn = importlib.import_module("manipnet_live.panel"), []
    layout = SimpleNamespace(
        column=lambda: SimpleNamespace(prop=lambda _, name: drawn.append(name)),
        operator=lambda name, **_: drawn.append(name),
        label=lambda text, **_: drawn.append(text),
    )
    view = panel.MANIPNET_PT_panel()
    view.layout = layout
    context = SimpleNamespace(scene=SimpleNamespace(manipnet=None))
    view.draw(context)
    assert drawn == ["address", "actor", "delay", "armature", "follow_wrists", "manipnet.connect"]
    with publishing() as (_, tcp, _):
        blender.session.start(tcp, "", 0.05, None, False)
        show_until(blender, lambda: blender.session.stats().rate_hz > 0)
        view.draw(context)
        blender.session.stop()
    assert "connected" in drawn
    assert " Hz, age " in drawn[-1]
    assert drawn[-1].endswith(" lost")


def test_the_zip_holds_the_manifest_and_the_client(tmp_path):
    path = package.write_zip(tmp_path / "dist")
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    assert path.name == f"manipnet_live-{__version__}.zip"
    assert {"__init__.py", "manipnet_client/__init__.py", "manipnet_client/layout.py"} <= set(names)
    assert not [name for name in names if "__pycache__" in name or name.endswith(".md")]
    assert manifest["version"] == __version__
    assert manifest["blender_version_min"] == "4.2.0"
    assert manifest["id"] == package.EXTENSION.name
    assert set(manifest["permissions"]) == {"network"}
