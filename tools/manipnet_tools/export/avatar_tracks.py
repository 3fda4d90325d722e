"""An animation carried onto the hands of an avatar: contact is solved again, on the avatar's own bones."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from manipnet.geometry import (
    Array,
    Side,
    invert,
    transform,
)
from manipnet.synthesis.carrying import HandCarrier, Held
from manipnet.synthesis.hand.avatar import avatar_hand
from manipnet.synthesis.hand.hand import Hand, Skin
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.synthesis.objects.shape import Shape, build_shape
from manipnet.synthesis.synthesizer import hand_to_world
from manipnet_tools.export.animation import Animation, HandTrack, hand_track
from manipnet_tools.export.csv_out import hand_angles

CHANGE_M: Final = 0.02
"""Another object must be nearer by this much for the hand to change to it."""
_SEGMENTS: Final = 12


def carry_animation(animation: Animation, profile: HandProfile) -> Animation:
    """The animation with the avatar's hands, about the objects whose meshes are known."""
    shapes = {name: build_shape(mesh) for name, mesh in animation.meshes.items() if name in animation.objects}
    poses = {name: animation.objects[name].poses for name in shapes}
    hands = {side: _carried(side, track, profile, shapes, poses) for side, track in animation.hands.items()}
    return replace(animation, hands=hands)


def _carried(
    side: Side, track: HandTrack, profile: HandProfile, shapes: Mapping[str, Shape], poses: Mapping[str, Array]
) -> HandTrack:
    avatar = avatar_hand(profile.hands[side], side, track.model)
    carrier = HandCarrier(avatar, track.model, side)
    held = _held(track, shapes, poses)
    angles = hand_angles(track.model, side, track.world()[1])
    carried = [carrier.step(*each, track.scale) for each in zip(angles, track.wrist, held, strict=True)]
    wrist = np.stack([pose.wrist for pose in carried])
    positions, rotations = forward_kinematics(avatar.hand, np.stack([pose.angles for pose in carried]))
    hand = replace(avatar.hand, skin=capsule_skin(avatar.hand))
    return replace(hand_track(hand, *hand_to_world(side, wrist, positions, rotations)), live=track.live)


def _held(track: HandTrack, shapes: Mapping[str, Shape], poses: Mapping[str, Array]) -> list[Held | None]:
    """The object that is nearest to the middle of the hand at each frame."""
    if not shapes:
        return [None] * len(track.wrist)
    middle, names = track.world()[0].mean(axis=1), list(shapes)
    gaps = np.stack(
        [shape.signed_distance(transform(invert(poses[name]), middle))[0] for name, shape in shapes.items()]
    )
    held, now = [], int(gaps[:, 0].argmin())
    for k, gap in enumerate(gaps.T):
        now = int(gap.argmin()) if gap.min() < gap[now] - CHANGE_M else now
        held.append((shapes[names[now]], poses[names[now]][k], 1.0))
    return held


def capsule_skin(hand: Hand) -> Skin:
    """A skin made of the capsules of a hand, each of which moves with one bone."""
    import trimesh

    positions, _ = forward_kinematics(hand, np.zeros(hand.angle_count))
    vertices, faces, bones = [], [], []
    for (start, end), radius in zip(hand.capsules.tolist(), hand.radii.tolist(), strict=True):
        along = positions[end] - positions[start]
        capsule = trimesh.creation.capsule(float(np.linalg.norm(along)), radius, count=(_SEGMENTS, _SEGMENTS))
        turn = np.asarray(trimesh.geometry.align_vectors([0.0, 0.0, 1.0], along))[:3, :3]
        faces.append(capsule.faces + sum(map(len, vertices)))
        vertices.append(capsule.vertices @ turn.T + positions[start])
        bones.append(np.full(len(capsule.vertices), start))
    owners = np.zeros((sum(map(len, vertices)), 4), np.int64)
    owners[:, 0] = np.concatenate(bones)
    weights = np.tile([1.0, 0.0, 0.0, 0.0], (len(owners), 1))
    return Skin(
        np.concatenate(vertices), np.concatenate(faces).astype(np.int32), owners, weights, np.zeros(hand.angle_count)
    )
