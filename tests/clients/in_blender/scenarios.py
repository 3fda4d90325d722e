"""Scenarios in a real Blender, each a function: `python scenarios.py NAME EXTENSIONS HANDS_ADDRESS FOLDER`.

EXTENSIONS is a folder with the packaged extension. Blender without a window runs no timers, so the function of the
extension's timer is called here.
"""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false
# ruff: noqa: E402  (the extension is imported from the folder that the command line names)

import math
import os
import sys
import threading
import time
import traceback
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).parent))
_, NAME, EXTENSIONS, ADDRESS, FOLDER = sys.argv[-5:] if len(sys.argv) >= 5 else [""] * 5
sys.path.insert(0, EXTENSIONS)
import manipnet_live
from manipnet_live import recording
from manipnet_live.bones import RigError
from manipnet_live.character import Cast
from manipnet_live.session import session
from rigs import FINGERS, armature, curves_of, deviations_deg, keyed_action, keys_of

WAIT_S = 30.0
INDEX = 'pose.bones["LeftHandIndex1"].rotation_quaternion'


def mixamo(side):
    return lambda finger, part: f"{side}Hand{FINGERS[finger]}{part + 1}"


@contextmanager
def refused(kind, text):
    """The block must raise this kind of error, with this text in it."""
    try:
        yield
    except kind as error:
        message = str(error)
    else:
        message = "no error"
    assert text in message, message


def tick():
    session._tick()
    bpy.context.view_layer.update()
    time.sleep(0.01)


def until(condition):
    give_up = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < give_up, f"never true; problems: {session.problems}"
        tick()


def start(*cast, control="tcp://127.0.0.1:5557", props=False):
    session.start(ADDRESS, 0.05, cast, control, props)
    until(lambda: all(character.shown for character in session.characters))
    for _ in range(3):
        tick()


def record(seconds=0.5, **how):
    session.start_recording()
    end = time.monotonic() + seconds
    until(lambda: time.monotonic() > end and all(len(t) > 5 for t in session._recording.tracks if len(t)))
    return session.stop_recording(**how)


def takes():
    return [action for action in bpy.data.actions if action.name.startswith(recording.TAKE)]


def shown(side, character=0):
    return session.characters[character].shown.hand(side)


def in_blender(pose):
    return np.array([pose[0], -pose[2], pose[1]])


def head(rig, bone):
    return np.array(rig.matrix_world @ rig.pose.bones[bone].head)


# -- poses ---------------------------------------------------------------------------------------------------------


def fingers_point_where_the_hand_does():
    rig = armature()
    start(Cast("Anna", rig))
    for side in ("Left", "Right"):
        assert deviations_deg(rig, shown(side.lower()), mixamo(side)).max() < 0.5


def a_rig_in_centimetres_keeps_its_size():
    for connected in (False, True):
        rig = armature("Rig", scale=0.01, arms=connected, connected=connected)
        start(Cast("Anna", rig, True))
        bone = rig.pose.bones["LeftHand"]
        assert np.allclose(bone.scale, 1.0)
        assert np.allclose(bone.matrix.to_scale(), 1.0, atol=1e-4)
        length = (rig.matrix_world @ rig.pose.bones["LeftHandIndex1"].tail - rig.matrix_world @ bone.tail).length
        assert length < 0.2, length
        if not connected:
            assert np.allclose(head(rig, "LeftHand"), in_blender(shown("left").wrist), atol=2e-3)
            assert deviations_deg(rig, shown("left"), mixamo("Left"), absolute=True).max() < 1.0
        record()
        frame = bpy.context.scene.frame_current
        session.stop()
        bpy.context.scene.frame_set(frame + 5)
        assert np.allclose(bone.matrix.to_scale(), 1.0, atol=1e-3)
        bpy.data.objects.remove(rig)


def one_hand_is_enough():
    rig = armature(sides=("Right",))
    start(Cast("Ben", rig))
    assert "left hand" in session.problems[0]
    assert deviations_deg(rig, shown("right"), mixamo("Right")).max() < 0.5
    assert record() > 5
    assert {curve[0].split('"')[1][:5] for curve in curves_of(takes()[0])} == {"Right"}


def one_tracked_hand_is_recorded():
    rig = armature()
    start(Cast("Ben", rig))
    assert record() > 5
    names = {curve[0].split('"')[1] for curve in curves_of(takes()[0])}
    assert names == {mixamo("Right")(finger, part) for finger in range(5) for part in range(3)}


def missing_finger_bones_are_named_and_the_rest_is_driven():
    lacking = ("LeftHandPinky1", "LeftHandPinky2", "LeftHandPinky3", "LeftHandRing3")
    rig = armature(without=lacking)
    start(Cast("Anna", rig))
    assert "LittleProximal" in session.problems[0]
    assert "RingDistal" in session.problems[0]
    have = {bone.name for bone in rig.data.bones}
    name_of = mixamo("Left")
    worst = deviations_deg(rig, shown("left"), lambda f, p: name_of(f, p) if name_of(f, p) in have else None).max()
    assert worst < 1.0, worst


def an_armature_without_hands_is_refused_by_name():
    rig = armature(rename=lambda name: f"bone of {name}")
    with refused(RigError, "Rig has no bone for Hand, ThumbProximal"):
        session.start(ADDRESS, 0.05, [Cast("Anna", rig)])
    assert not session.is_running
    assert threading.active_count() == 1


def fingers_without_parents_are_refused():
    for loosened in (FINGERS, ("Index",)):
        for parts in ((1, 2, 3), (1,)):
            rig = armature(arms=True)
            bpy.ops.object.mode_set(mode="EDIT")
            for finger in loosened:
                for part in parts:
                    rig.data.edit_bones[f"LeftHand{finger}{part}"].parent = None
                    rig.data.edit_bones[f"RightHand{finger}{part}"].parent = None
            bpy.ops.object.mode_set(mode="OBJECT")
            with refused(RigError, f"LeftHand{loosened[0]}1"):
                start(Cast("Anna", rig))
            with refused(RigError, "have no parent, so they cannot follow the hand; parent them"):
                start(Cast("Anna", rig))
            bpy.data.objects.remove(rig)


def a_bone_map_serves_bones_with_any_name():
    rig = armature(rename=lambda name: "b" + name[::-1])
    parts = ("Proximal", "Intermediate", "Distal")
    bone_map = {"LeftHand": "bdnaHtfeL", "RightHand": "bdnaHthgiR"}
    for side in ("Left", "Right"):
        for finger, word in enumerate(("Thumb", "Index", "Middle", "Ring", "Little")):
            for part in range(3):
                bone_map[f"{side}{word}{parts[part]}"] = "b" + mixamo(side)(finger, part)[::-1]
    scene = bpy.context.scene
    assert bpy.ops.manipnet.add_character() == {"FINISHED"}
    chosen = scene.manipnet.characters[0]
    chosen.armature, chosen.actor = rig, "Anna"
    path = Path(FOLDER) / "map.json"
    chosen.set_bone_map(bone_map)
    assert bpy.ops.manipnet.save_bone_map(filepath=str(path), index=0) == {"FINISHED"}
    saved = path.read_text()
    for content in (saved, saved.replace("LeftIndexProximal", "LeftHandIndex1").replace('LeftHand"', 'hand_l"')):
        path.write_text(content)
        chosen.bones.clear()
        assert bpy.ops.manipnet.load_bone_map(filepath=str(path), index=0) == {"FINISHED"}
        assert chosen.bone_map() == bone_map
    start(*scene.manipnet.cast())
    left = mixamo("Left")
    assert deviations_deg(rig, shown("left"), lambda f, p: "b" + left(f, p)[::-1]).max() < 0.5
    session.stop()
    for text, said in (('{"LeftToe": "x"}', "allowed are LeftHand"), ("[", "is not JSON")):
        path.write_text(text)
        with refused(RuntimeError, said):
            bpy.ops.manipnet.load_bone_map(filepath=str(path), index=0)


def generated_rigify_follows_with_fingers_and_wrists():
    bpy.ops.preferences.addon_enable(module="rigify")
    bpy.ops.object.armature_human_metarig_add()
    bpy.ops.pose.rigify_generate()
    rig = next(each for each in bpy.data.objects if each.type == "ARMATURE" and each.name != "metarig")
    fingers = ("thumb", "f_index", "f_middle", "f_ring", "f_pinky")
    start(Cast("Anna", rig, True))
    rig.location = Vector(in_blender(shown("left").wrist)) - Vector((0.35, 0.0, 1.3))
    for _ in range(30):
        tick()
    for side, letter in (("left", "L"), ("right", "R")):
        hand = shown(side)
        controls = lambda f, p: f"{fingers[f]}.0{p + 1}.{letter}"  # noqa: E731, B023
        worst = deviations_deg(rig, hand, controls, absolute=True).max()
        assert worst < 1.5, (side, worst)
        deform = lambda f, p: f"DEF-{fingers[f]}.0{p + 1}.{letter}"  # noqa: E731, B023
        assert deviations_deg(rig, hand, deform, absolute=True).max() < 2.0
        far = np.linalg.norm(head(rig, f"DEF-hand.{letter}") - in_blender(hand.wrist))
        assert far < 0.02, far
    assert record() > 5
    assert any(path[0] == 'pose.bones["hand_ik.L"].location' for path in curves_of(takes()[0]))


def rigifys_bones_keep_their_own_roll():
    """The metarig's own hinges disagree by up to 10 degrees along one finger, so they cannot all be the model's.

    Bones turn from their rest pose without a twist: their roll about themselves, against the hinges of the message, is
    bounded and the same in every pose.
    """
    bpy.ops.preferences.addon_enable(module="rigify")
    bpy.ops.object.armature_human_metarig_add()
    rig = bpy.context.object
    start(Cast("Anna", rig, True))
    fingers = ("thumb", "f_index", "f_middle", "f_ring", "f_pinky")
    rolls = []
    for _ in range(20):
        tick()
        for side in ("left", "right"):
            turn = [
                rolls_deg(rig, shown(side), f"{name}.0{part + 1}.{side[0].upper()}", 5 * k + 2 + part)
                for k, name in enumerate(fingers)
                for part in range(3)
            ]
            rolls.append(turn)
    for one_side in (rolls[::2], rolls[1::2]):
        assert np.abs(one_side).max() < 12.0, np.abs(one_side).max()
        assert np.ptp(one_side, axis=0).max() < 1.0, np.ptp(one_side, axis=0)


def rolls_deg(rig, hand, name, joint):
    """The angle about a bone between its hinge, its own x axis, and that of a joint of the message."""
    place = np.array(rig.matrix_world.to_3x3() @ rig.pose.bones[name].matrix.to_3x3())
    x, y, z, w = hand.joints[joint, 3:]
    hinge = np.array([1 - 2 * (y * y + z * z), -2 * (x * z - y * w), 2 * (x * y + z * w)])
    across = np.cross(hinge, place[:, 0])
    return (np.degrees(np.arctan2(across @ place[:, 1], hinge @ place[:, 0])) + 90.0) % 180.0 - 90.0


def a_connected_hand_is_reached_by_inverse_kinematics():
    rig = armature(arms=True, connected=True)
    rig.location = (-0.2, -0.1, -0.2)
    start(Cast("Anna", rig, True))
    for _ in range(40):
        tick()
    far = np.linalg.norm(head(rig, "LeftHand") - in_blender(shown("left").wrist))
    assert far < 0.02, (far, session.problems)
    assert deviations_deg(rig, shown("left"), mixamo("Left"), absolute=True).max() < 2.0
    session.start_recording()
    end = time.monotonic() + 0.6
    until(lambda: time.monotonic() > end)
    last = head(rig, "LeftHand")
    frame = bpy.context.scene.frame_current
    frames = session.stop_recording()
    session.stop()
    assert not [c for bone in rig.pose.bones for c in bone.constraints]
    assert not [each for each in bpy.data.objects if each.name.endswith("_target")]
    bpy.context.scene.frame_set(frame + frames - 1)
    assert np.linalg.norm(head(rig, "LeftHand") - last) < 0.02
    assert {"LeftArm", "LeftForeArm", "LeftHand"} <= {path[0].split('"')[1] for path in curves_of(takes()[0])}


def a_hand_that_cannot_reach_its_wrist_is_reported():
    rig = armature(arms=True, connected=True)
    rig.location = (5.0, 0.0, 0.0)
    start(Cast("Anna", rig, True))
    until(lambda: any("left hand is" in problem for problem in session.problems))


def several_actors_drive_their_own_armatures():
    first, second = armature("First"), armature("Second")
    start(Cast("Anna", first), Cast("Ben", second))
    assert [character.shown.actor for character in session.characters] == ["Anna", "Ben"]
    assert deviations_deg(second, shown("right", 1), mixamo("Right")).max() < 0.5
    record()
    assert len(takes()) == 2
    assert all(rig.animation_data.nla_tracks for rig in (first, second))


def rotation_modes_of_the_user_stay():
    rig = armature()
    rig.pose.bones["LeftHandIndex1"].rotation_mode = "XYZ"
    rig.pose.bones["LeftHandIndex2"].rotation_mode = "AXIS_ANGLE"
    for name in ("LeftHandIndex3", "LeftHandMiddle1"):
        rig.pose.bones[name].rotation_mode = "ZYX"
    for bone in rig.pose.bones:
        if bone.name.startswith("Right"):
            bone.rotation_mode = "YZX"
    modes = {bone.name: bone.rotation_mode for bone in rig.pose.bones}
    start(Cast("Anna", rig))
    assert modes == {bone.name: bone.rotation_mode for bone in rig.pose.bones}
    for side in ("Left", "Right"):
        assert deviations_deg(rig, shown(side.lower()), mixamo(side)).max() < 0.5
    bpy.context.scene.frame_set(1)
    session.start_recording()
    end = time.monotonic() + 0.5
    until(lambda: time.monotonic() > end)
    hand = shown("right")
    frames = session.stop_recording()
    session.stop()
    bpy.context.scene.frame_set(frames)
    assert deviations_deg(rig, hand, mixamo("Right")).max() < 8.0  # up to one frame of the scene later


# -- takes ---------------------------------------------------------------------------------------------------------


def a_take_leaves_the_actions_of_the_user_alone():
    rig = armature()
    body = keyed_action(rig, "Body", {("location", 0): {1: 0.0, 50: 2.0}, (INDEX, 1): {1: 0.1, 50: 0.5}})
    before = keys_of(body)
    scene = bpy.context.scene
    start(Cast("Anna", rig))
    for _ in range(2):
        scene.frame_set(10)
        assert record() > 5
    session.stop()
    assert keys_of(body) == before
    assert len(takes()) == 2
    assert all(action.use_fake_user and action.users > 1 for action in takes())
    for frame in (1, 20, 50):
        scene.frame_set(frame)
        assert math.isclose(rig.location[0], curves_of(body)["location", 0].evaluate(frame), abs_tol=1e-5)
    scene.frame_set(15)
    bone, taken = rig.pose.bones["LeftHandIndex1"], curves_of(takes()[1])
    assert np.allclose(bone.rotation_quaternion, [taken[INDEX, i].evaluate(15) for i in range(4)], atol=1e-4)
    scene.frame_set(45)
    assert math.isclose(bone.rotation_quaternion[1], curves_of(body)[INDEX, 1].evaluate(45), abs_tol=1e-4)
    path = str(Path(FOLDER) / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert keys_of(bpy.data.actions["Body"]) == before
    assert len(takes()) == 2


def an_action_without_common_bones_stays_assigned():
    rig = armature()
    body = keyed_action(rig, "Body", {("location", 0): {1: 0.0, 50: 2.0}})
    start(Cast("Anna", rig))
    record()
    assert rig.animation_data.action == body
    track = rig.animation_data.nla_tracks[0]
    assert track.strips[0].action == takes()[0]
    bpy.context.scene.frame_set(5)
    assert abs(rig.pose.bones["LeftHandIndex1"].rotation_quaternion[0]) < 1.0


def a_take_in_tweak_mode_harms_nothing():
    rig = armature()
    body = keyed_action(rig, "Body", {(INDEX, 1): {1: 0.1, 50: 0.5}})
    data = rig.animation_data
    strip = data.nla_tracks.new().strips.new("Body", 1, body)
    before = keys_of(body)
    data.action = None
    data.nla_tracks.active = data.nla_tracks[0]
    strip.select = True
    data.use_tweak_mode = True
    start(Cast("Anna", rig))
    assert record() > 5
    assert keys_of(body) == before
    assert len(data.nla_tracks) == 2


def keyframes_have_groups_range_and_rate():
    rig, scene = armature(), bpy.context.scene
    scene.render.fps, scene.frame_end = 24, 20
    start(Cast("Anna", rig))
    scene.frame_set(10)
    frames = record(1.0)
    curve = curves_of(takes()[0])[INDEX, 0]
    assert [point.co[0] for point in curve.keyframe_points] == list(range(10, 10 + frames))
    assert curve.group.name == "LeftHandIndex1"
    assert scene.frame_end == 10 + frames - 1 > 20
    scene.frame_end = 20
    record(1.0, start_at="SCENE", within_scene=True, keys_per_second=12.0)
    points = [point.co[0] for point in curves_of(takes()[1])[INDEX, 0].keyframe_points]
    assert points[:3] == [1.0, 3.0, 5.0], points
    assert points[-1] <= 20
    assert scene.frame_end == 20


def a_take_begins_at_its_timecode():
    rig, scene = armature(), bpy.context.scene
    scene.render.fps = 24
    start(Cast("Anna", rig))
    record(start_at="TIMECODE")
    action = takes()[0]
    hours, minutes, seconds, frames = (int(each) for each in action["timecode"].split(":"))
    assert hours == 1
    counted = (3600 * hours + 60 * minutes + seconds) * 30 + frames
    first = curves_of(action)[INDEX, 0].keyframe_points[0].co[0]
    assert math.isclose(first, counted / 30 * 24, abs_tol=1e-2), (first, action["timecode"])
    assert action["timecode_rate"] == 30.0
    assert action.pose_markers[0].name == action["timecode"]


def drop_frame_timecode_is_counted():
    from manipnet_live.timecode import timecode_frames

    assert timecode_frames("00:00:59;29", 29.97) == 1799
    assert timecode_frames("00:01:00;02", 29.97) == 1800
    assert timecode_frames("00:10:00;00", 29.97) == 17982
    assert timecode_frames("01:00:00;00", 59.94) == 215784
    assert timecode_frames("00:00:02:05", 25.0) == 55


# -- what users do meanwhile ---------------------------------------------------------------------------------------


def undo_while_recording_loses_nothing():
    rig = armature()
    bpy.ops.ed.undo_push(message="begin")
    bpy.data.objects.new("other", None)
    bpy.ops.ed.undo_push(message="other")
    start(Cast("Anna", rig, True))
    session.start_recording()
    until(lambda: len(session._recording.tracks[0]) > 10)
    assert bpy.ops.ed.undo() == {"FINISHED"}
    recorded = len(session._recording.tracks[0])
    until(lambda: len(session._recording.tracks[0]) > recorded + 10)
    assert session.stop_recording() > 5
    session.stop()
    assert bpy.data.objects["Rig"].animation_data.nla_tracks


def a_deleted_armature_ends_nothing_and_the_take_is_kept():
    rig = armature()
    bpy.ops.ed.undo_push(message="begin")
    start(Cast("Anna", rig))
    session.start_recording()
    until(lambda: len(session._recording.tracks[0]) > 20)
    bpy.data.objects.remove(rig)
    bpy.ops.ed.undo_push(message="deleted")
    for _ in range(5):
        tick()
    assert session.is_running
    assert session.stop_recording() > 5
    session.stop()
    assert takes()[0].use_fake_user


def a_renamed_armature_is_still_followed():
    rig = armature()
    start(Cast("Anna", rig))
    rig.name = "Another name"
    armature("Rig")
    for _ in range(3):
        tick()
    assert deviations_deg(rig, shown("left"), mixamo("Left")).max() < 0.5
    record()
    assert rig.animation_data.nla_tracks


def a_deleted_bone_stops_only_its_hand():
    rig = armature()
    start(Cast("Anna", rig))
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    rig.data.edit_bones.remove(rig.data.edit_bones["LeftHandIndex3"])
    bpy.ops.object.mode_set(mode="OBJECT")
    for _ in range(3):
        tick()
    assert session.is_running
    assert deviations_deg(rig, shown("right"), mixamo("Right")).max() < 0.5


def opening_files_ends_the_session_and_keeps_the_take():
    path = str(Path(FOLDER) / "other.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    threads = threading.active_count()
    for turn in range(2):
        rig = armature()
        start(Cast("Anna", rig, True))
        session.start_recording()
        until(lambda: len(session._recording.tracks[0]) > 20)
        bpy.ops.wm.open_mainfile(filepath=path)
        assert not session.is_running, turn
        assert threading.active_count() == threads
        assert len(takes()) == 1, turn
        assert not bpy.app.timers.is_registered(session._tick)
    manipnet_live.unregister()
    manipnet_live.register()
    assert hasattr(bpy.context.scene, "manipnet")


def a_saved_file_has_no_remains_of_the_session():
    path = str(Path(FOLDER) / "saved.blend")
    rig = armature(arms=True, connected=True)
    start(Cast("Anna", rig, True))
    assert [c for bone in rig.pose.bones for c in bone.constraints]
    bpy.ops.wm.save_as_mainfile(filepath=path)
    tick()
    assert [c for bone in rig.pose.bones for c in bone.constraints], "the session goes on"
    session.stop()
    bpy.ops.wm.open_mainfile(filepath=path)
    assert not [c for bone in bpy.data.objects["Rig"].pose.bones for c in bone.constraints]


def objects_of_the_user_are_not_taken_over():
    mine = bpy.data.objects.new("manipnet_left_wrist", None)
    bpy.context.scene.collection.objects.link(mine)
    mine.location = (7, 7, 7)
    start(Cast("Anna"))
    assert tuple(mine.location) == (7, 7, 7)
    empties = [each for each in bpy.data.objects if each.get("manipnet_live") == "manipnet_Anna_left_wrist"]
    assert len(empties) == 1
    bpy.data.objects.remove(empties[0])
    tick()
    found = next(each for each in bpy.data.objects if each.get("manipnet_live") == "manipnet_Anna_left_wrist")
    assert np.allclose(found.location, in_blender(shown("left").wrist), atol=1e-5)


def operators_connect_record_and_disconnect():
    scene = bpy.context.scene
    scene.manipnet.address = "nowhere"
    with refused(RuntimeError, "tcp://HOST:PORT"):
        bpy.ops.manipnet.connect()
    armature()
    assert bpy.ops.manipnet.add_character() == {"FINISHED"}
    assert scene.manipnet.characters[0].armature.name == "Rig"
    scene.manipnet.characters[0].actor = "Anna"
    assert bpy.ops.manipnet.find_bones(index=0) == {"FINISHED"}
    assert scene.manipnet.characters[0].bone_map()["RightLittleDistal"] == "RightHandPinky3"
    scene.manipnet.address = ADDRESS
    assert bpy.ops.manipnet.connect() == {"FINISHED"}
    until(lambda: session.characters[0].shown)
    assert bpy.ops.manipnet.record() == {"FINISHED"}
    until(lambda: len(session._recording.tracks[0]) > 10)
    assert bpy.ops.manipnet.record() == {"FINISHED"}
    assert takes()
    assert bpy.ops.manipnet.record() == {"FINISHED"}
    until(lambda: len(session._recording.tracks[0]) > 10)
    assert bpy.ops.manipnet.disconnect() == {"FINISHED"}
    assert len(takes()) == 2
    assert threading.active_count() == 1


def props_come_with_their_meshes_and_are_recorded():
    control = os.environ["MANIPNET_CONTROL"]
    start(Cast(), control=control, props=True)
    until(lambda: "manipnet_mesh_Box" in bpy.data.objects)
    mesh = bpy.data.objects["manipnet_mesh_Box"]
    bounds = [max(v.co[i] for v in mesh.data.vertices) - min(v.co[i] for v in mesh.data.vertices) for i in range(3)]
    assert all(0.01 < side < 0.5 for side in bounds), bounds
    bpy.context.view_layer.update()
    box = next(each for each in session.characters[0].shown.bodies if each.name == "Box")
    assert np.allclose(mesh.parent.location, in_blender(box.pose), atol=1e-5)
    assert session.can_record
    assert record(1.0) > 5
    assert any("Box" in action.name for action in takes())
    empty = mesh.parent
    bpy.context.scene.frame_set(3)
    assert np.allclose(empty.matrix_world.to_translation(), empty.location)
    bpy.data.objects.remove(mesh)
    until(lambda: "manipnet_mesh_Box" in bpy.data.objects)


def main(scenarios):
    manipnet_live.register()
    bpy.ops.wm.read_homefile(use_empty=True)
    try:
        scenarios[NAME]()
        session.stop()
        manipnet_live.unregister()
        status = 0
    except BaseException:
        traceback.print_exc()
        status = 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)  # the module of PyPI hangs in its own clean-up when the interpreter ends normally


if __name__ == "__main__":
    main(globals())
