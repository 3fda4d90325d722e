"""Scenarios in a real Blender with a real server, run as those of scenarios.py; MANIPNET_CONTROL is its address."""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

import os
from functools import partial

import bpy
import numpy as np
import scenarios
from manipnet_live.character import Cast
from manipnet_live.manipnet_client.avatar import FIRST_JOINTS, TIP_JOINTS, WRIST
from manipnet_live.manipnet_client.retarget import rotate
from manipnet_live.session import session
from mathutils import Vector
from rigs import FINGERS, armature
from scenarios import WAIT_S, in_blender, shown, tick, until

CONTROL = os.environ.get("MANIPNET_CONTROL", "")
NEAR_M = 1e-3


def solve_on(rig, follow=True):
    """Connect with the armature as the avatar, and wait until its hands arrive."""
    session.start(scenarios.ADDRESS, 0.05, [Cast("", rig, follow, None, True)], CONTROL)
    until(lambda: session.characters[0].shown and shown("left") and shown("right"))


def tips_m(rig, tail_of):
    """Where the rig's fingertips are, `(5, 3)`."""
    return np.array([rig.matrix_world @ rig.pose.bones[tail_of(finger)].tail for finger in range(5)])


def far_m(tips, hand):
    """The largest distance of fingertips from where a message has them."""
    wanted = np.array([in_blender(hand.joints[joint]) for joint in TIP_JOINTS])
    return np.linalg.norm(tips - wanted, axis=1).max()


def chained_tips(hand, avatar):
    """Where fingertips are, `(5, 3)`, if bones of the lengths at rest follow the wrist and rotations of a message."""
    wrist, tips = hand.joints[WRIST], []
    for first in FIRST_JOINTS:
        links = np.linalg.norm(np.diff(avatar.joints[first : first + 4, :3], axis=0), axis=1)
        at = wrist[:3] + rotate(wrist[3:], avatar.joints[first, :3])
        for joint, length in enumerate(links, first):
            at = at + rotate(hand.joints[joint, 3:], np.array([0.0, 0.0, -length]))
        tips.append(in_blender(at))
    return np.array(tips)


def check_tips(rig, tail_of):
    """For a while, no fingertip lies more than a millimetre from where a message has it.

    Messages as they arrive are compared by their positions. The shown ones are means of several, whose positions no
    bones of constant lengths can have, so that the bones follow the wrist and the rotations.
    """
    for _ in range(40):
        tick()
    character = session.characters[0]
    hands = {side: character._hands[side] for side in ("left", "right")}
    message, arrived, chained = None, [], []
    for _ in range(60):
        tick()
        for side, hand in hands.items():
            ours = tips_m(rig, partial(tail_of, side))
            chained.append(np.linalg.norm(ours - chained_tips(shown(side), hand.avatar), axis=1).max())
        message = character._client.wait(message, WAIT_S)
        for side, hand in hands.items():
            hand.show(message.hand(side), 1.0)
        bpy.context.view_layer.update()
        arrived += [far_m(tips_m(rig, partial(tail_of, side)), message.hand(side)) for side in hands]
    assert max(arrived) < NEAR_M, (arrived, session.problems)
    assert max(chained) < NEAR_M, (chained, session.problems)
    assert not session.problems, session.problems


def within_reach(rig, left_hand):
    """Move the armature so that both hands can reach their wrists."""
    bpy.context.view_layer.update()
    shoulder = rig.matrix_world @ rig.pose.bones[left_hand].head
    rig.location += (
        Vector(in_blender(shown("left").joints[1])) - Vector((0.22, 0.12, 0.0)) - Vector((0, 0, shoulder[2]))
    )


# -- the server solves on the avatar --------------------------------------------------------------------------------


def fingertips_of_a_rig_in_centimetres():
    rig = armature(scale=0.01)
    solve_on(rig)
    check_tips(rig, lambda side, finger: f"{side.capitalize()}Hand{FINGERS[finger]}3")


def fingertips_of_a_hand_with_a_missing_bone():
    rig = armature(without=("LeftHandRing3", "RightHandThumb3"))
    solve_on(rig)
    for _ in range(40):
        tick()
    last = {("left", 3): "LeftHandRing2", ("right", 0): "RightHandThumb2"}
    for side in ("left", "right"):
        name_of = lambda f, s=side: last.get((s, f), f"{s.capitalize()}Hand{FINGERS[f]}3")  # noqa: E731
        assert far_m(tips_m(rig, name_of), shown(side)) < NEAR_M


def fingertips_of_rigifys_metarig():
    bpy.ops.preferences.addon_enable(module="rigify")
    bpy.ops.object.armature_human_metarig_add()
    rig = bpy.context.object
    solve_on(rig)
    within_reach(rig, "upper_arm.L")
    check_tips(rig, lambda side, finger: f"{rigify(finger)}.03.{side[0].upper()}")


def fingertips_of_a_generated_rig_of_rigify():
    bpy.ops.preferences.addon_enable(module="rigify")
    bpy.ops.object.armature_human_metarig_add()
    bpy.ops.pose.rigify_generate()
    rig = next(each for each in bpy.data.objects if each.type == "ARMATURE" and each.name != "metarig")
    solve_on(rig)
    within_reach(rig, "DEF-upper_arm.L")
    check_tips(rig, lambda side, finger: f"DEF-{rigify(finger)}.03.{side[0].upper()}")


def rigify(finger):
    return ("thumb", "f_index", "f_middle", "f_ring", "f_pinky")[finger]


def fingers_alone_follow_a_wrist_of_the_user():
    rig = armature(scale=0.01)
    rig.pose.bones["LeftHand"].rotation_quaternion = (0.8, 0.6, 0.0, 0.0)
    solve_on(rig, follow=False)
    for _ in range(20):
        tick()
    hand = shown("left")
    wrist = rig.pose.bones["LeftHand"].matrix
    place = rig.matrix_world @ wrist
    ours = [
        place.to_quaternion().inverted() @ (rig.matrix_world @ bone(rig, f).tail - place.to_translation())
        for f in range(5)
    ]
    theirs = hand.joints[list(TIP_JOINTS), :3] - hand.joints[1, :3]
    between = lambda points: np.linalg.norm(points[:, None] - points[None], axis=-1)  # noqa: E731
    assert np.abs(between(np.array(ours)) - between(theirs)).max() < NEAR_M


def bone(rig, finger):
    return rig.pose.bones[f"LeftHand{FINGERS[finger]}3"]


def a_refusal_has_the_reason_of_the_server():
    rig = armature()
    rig.scale = (10.0, 10.0, 10.0)
    bpy.context.view_layer.update()
    session.start(scenarios.ADDRESS, 0.05, [Cast("", rig, True, None, True)], CONTROL)
    until(lambda: any("m long" in problem for problem in session.problems))
    assert "refuses the hand profile" in session.problems[0], session.problems


def a_stretched_armature_is_refused_with_the_remedy():
    rig = armature()
    rig.scale = (1.0, 1.0, 2.0)
    bpy.context.view_layer.update()
    with scenarios.refused(scenarios.RigError, "apply its scale"):
        session.start(scenarios.ADDRESS, 0.05, [Cast("", rig, True, None, True)], CONTROL)


# -- remote control --------------------------------------------------------------------------------------------------


def the_panel_controls_the_server():
    session.start(scenarios.ADDRESS, 0.05, [Cast()], CONTROL)
    remote, chosen = session.remote, bpy.context.scene.manipnet
    until(lambda: remote.state.objects)
    assert not remote.problem
    (actor,) = remote.state.bodies
    assert bpy.ops.manipnet.select_object(actor=actor, body="Box", object="mug") == {"FINISHED"}
    until(lambda: remote.state.bodies[actor]["Box"]["object"] == "mug")
    assert "mug" in remote.message, remote.message
    chosen.look_ahead = 0.25
    until(lambda: remote.message == "Look-ahead is 0.25 s")
    assert bpy.ops.manipnet.rest() == {"FINISHED"}
    until(lambda: "rest" in remote.message)
    chosen.take_name = "from the panel"
    assert bpy.ops.manipnet.record_on_server() == {"FINISHED"}
    until(lambda: remote.state.recording is not None or "refuses" in remote.message)
    if remote.state.recording is not None:  # a server without --takes refuses, and says so
        assert bpy.ops.manipnet.record_on_server() == {"FINISHED"}
        until(lambda: remote.message.startswith("Recorded"))
    assert bpy.ops.manipnet.select_object(actor=actor, body="Box", object="cube") == {"FINISHED"}
    until(lambda: remote.state.bodies[actor]["Box"]["object"] == "cube")


def requests_without_a_session_are_refused():
    with scenarios.refused(RuntimeError, "poll() failed"):
        bpy.ops.manipnet.rest()


def a_server_that_does_not_answer_is_named():
    session.start(scenarios.ADDRESS, 0.05, [Cast()], "tcp://127.0.0.1:1")
    until(lambda: session.remote.problem)
    assert "127.0.0.1:1" in session.remote.problem, session.remote.problem


if __name__ == "__main__":
    scenarios.main(globals())
