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
from manipnet.synthesis.carrying import AvatarPose, HandCarrier, Held
from manipnet.synthesis.hand.avatar import AvatarHand, avatar_hand
from manipnet.synthesis.hand.hand import Hand, Skin
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.synthesis.objects.shape import Shape, build_shape
from manipnet.synthesis.synthesizer import hand_to_world
from manipnet.wire.hand_names import OPENXR_PARENTS
from manipnet_tools.export.animation import Animation, HandTrack, hand_track
from manipnet_tools.export.csv_out import hand_angles

CHANGE_M: Final = 0.02
"""Another object must be nearer by this much for the hand to change to it."""
SAME_M: Final = 1e-4
"""Bones of the same avatar differ by less than this in length."""
_SEGMENTS: Final = 12


def carry_animation(animation: Animation, profile: HandProfile) -> Animation:
    """The animation with the avatar's hands, about the objects whose meshes are known."""
    hands = {}
    for side, (avatar, carried) in solve_hands(animation, profile).items():
        wrist = np.stack([pose.wrist for pose in carried])
        positions, rotations = forward_kinematics(avatar.hand, np.stack([pose.angles for pose in carried]))
        hand = replace(avatar.hand, skin=capsule_skin(avatar.hand))
        track = hand_track(hand, *hand_to_world(side, wrist, positions, rotations))
        hands[side] = replace(track, live=animation.hands[side].live)
    return replace(animation, hands=hands)


def joints_on(animation: Animation, profile: HandProfile) -> dict[Side, Array]:
    """The OpenXR joints `(T, 26, 7)` on the hands of a profile: those of the source if they are of it, else solved."""
    given = animation.avatar_joints
    if given and all(_same_lengths(given[side][0], profile.hands[side].joints) for side in given):
        return {side: joints for side, joints in given.items() if side in animation.hands}
    solved = solve_hands(animation, profile)
    return {side: np.stack([pose.joints for pose in poses]) for side, (_, poses) in solved.items()}


def _same_lengths(joints: Array, rest: Array) -> bool:
    """Whether the bones of posed joints have the lengths of a profile, as far as it has them."""
    lengths = [np.linalg.norm(each[1:, :3] - each[list(OPENXR_PARENTS[1:]), :3], axis=1)[1:] for each in (joints, rest)]
    known = ~np.isnan(lengths[1])
    return bool((np.abs(lengths[0] - lengths[1])[known] < SAME_M).all())


def solve_hands(animation: Animation, profile: HandProfile) -> dict[Side, tuple[AvatarHand, list[AvatarPose]]]:
    """The avatar's hands and their poses at each frame, about the objects whose meshes are known."""
    shapes = {name: build_shape(mesh) for name, mesh in animation.meshes.items() if name in animation.objects}
    poses = {name: animation.objects[name].poses for name in shapes}
    solved = {}
    for side, track in animation.hands.items():
        avatar = avatar_hand(profile.hands[side], side, track.model)
        carrier = HandCarrier(avatar, track.model, side)
        held = _held(track, shapes, poses)
        angles = hand_angles(track.model, side, track.world()[1])
        carried = [carrier.step(*each, track.scale) for each in zip(angles, track.wrist, held, strict=True)]
        solved[side] = avatar, carried
    return solved


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
