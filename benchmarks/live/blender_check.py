"""Run the Blender extension in a real Blender: connect, pose an armature, record, read the keyframes back.

With the module `bpy` of PyPI (`pip install bpy numpy`), which has no window:
`python benchmarks/live/blender_check.py tcp://127.0.0.1:5555`. In Blender itself:
`blender -b --python benchmarks/live/blender_check.py -- tcp://127.0.0.1:5555`. A server must run at that address, for
example `manipnet-serve --demo`. Blender without a window does not run timers, so this script calls the function of the
extension's timer.
"""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

import math
import os
import sys
import tempfile
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parents[2] / "clients" / "blender"))
import package

sys.path.insert(0, str(package.write_unpacked(Path(tempfile.mkdtemp())).parent))
import manipnet_live
from manipnet_live.session import session

FINGERS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
KNUCKLES = ((0.04, 0.03), (0.1, 0.03), (0.105, 0.0), (0.1, -0.02), (0.09, -0.04))


def make_armature():
    """Two hands with Mixamo's names, fingers straight ahead."""
    data = bpy.data.armatures.new("Hands")
    thing = bpy.data.objects.new("Hands", data)
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    bpy.ops.object.mode_set(mode="EDIT")
    for side, sign in (("Left", -1.0), ("Right", 1.0)):
        hand = data.edit_bones.new(f"{side}Hand")
        hand.head, hand.tail = (sign, 0, 0), (sign * 1.1, 0, 0)
        for finger, (x, y) in zip(FINGERS, KNUCKLES, strict=True):
            parent = hand
            for part in range(3):
                bone = data.edit_bones.new(f"{side}Hand{finger}{part + 1}")
                bone.head = (sign * (1 + x + 0.03 * part), y, 0)
                bone.tail = (sign * (1.03 + x + 0.03 * part), y, 0)
                bone.parent = parent
                parent = bone
    bpy.ops.object.mode_set(mode="OBJECT")
    return thing


def run_for(seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        session._tick()
        time.sleep(1 / 60)


def main():
    address = sys.argv[-1]
    manipnet_live.register()
    thing = make_armature()
    session.start(address, "", 0.05, thing, True)
    run_for(2.0)
    stats = session.stats()
    assert stats.received > 60, stats
    session.start_recording()
    run_for(2.0)
    frames = session.stop_recording()
    session.stop()
    action = thing.animation_data.action
    if hasattr(action, "layers") and len(action.layers):
        curves = action.layers[0].strips[0].channelbag(thing.animation_data.action_slot).fcurves
    else:
        curves = action.fcurves
    keys = [len(curve.keyframe_points) for curve in curves]
    assert len(keys) == 2 * (16 * 4 + 3), len(keys)  # fingers and wrists turn, wrists move
    assert set(keys) == {frames}, (frames, set(keys))
    bone = thing.pose.bones["LeftHandIndex1"]
    seen, places = set(), set()
    for frame in range(1, frames + 1):
        bpy.context.scene.frame_set(frame)
        assert math.isclose(bone.rotation_quaternion.magnitude, 1.0, abs_tol=1e-3)
        seen.add(tuple(round(x, 4) for x in bone.rotation_quaternion))
        places.add(tuple(round(x, 4) for x in thing.pose.bones["LeftHand"].location))
    manipnet_live.unregister()
    print(
        f"Blender {bpy.app.version_string}: {stats.received} frames received, {stats.lost} lost, "
        f"{frames} frames keyed on {len(keys)} curves, {len(seen)} different poses of a bone, {len(places)} of a wrist",
        flush=True,
    )


main()
os._exit(0)  # the module of PyPI 4.5 hangs in its own cleanup when the interpreter exits normally
