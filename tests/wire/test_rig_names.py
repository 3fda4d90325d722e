"""The one vocabulary of bone names: whole rigs of every family, and the clients' tables made from it."""

import re
import sys
from pathlib import Path

import pytest

from manipnet.wire.rig_names import FINGERS, find_bones, finger_names, plain

CLIENTS = Path(__file__).parents[2] / "clients"
WORDS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
LITTLE = (*WORDS[:4], "Little")
PARTS = ("Proximal", "Intermediate", "Distal")


def family(hand, pattern, words=WORDS, **more):
    """The bones of a left hand: `{hand, (finger, part): name}`; `{n}` counts from one, `{z}` from zero."""
    names = {
        (f, p): pattern.format(word=word, low=word.lower(), n=p + 1, z=p, p=PARTS[p], f=f, g=f + 1, m=p or "")
        for f, word in enumerate(words)
        for p in range(3)
    }
    return hand, names | more.get("thumb", {})


MMD = ("親指", "人指", "中指", "薬指", "小指")
XSENS = ("First", "Second", "Third", "Fourth", "Fifth")
VRM1_THUMB = {(0, 0): "leftThumbMetacarpal", (0, 1): "leftThumbProximal", (0, 2): "leftThumbDistal"}
FAMILIES = {
    "Mixamo": family("mixamorig:LeftHand", "mixamorig:LeftHand{word}{n}"),
    "Mixamo without colon": family("mixamorigLeftHand", "mixamorigLeftHand{word}{n}"),
    "Mixamo with underscore": family("mixamorig_LeftHand", "mixamorig_LeftHand{word}{n}"),
    "Ready Player Me": family("LeftHand", "LeftHand{word}{n}"),
    "VRM 0": family("leftHand", "left{word}{p}", LITTLE),
    "VRM 1": family("leftHand", "left{word}{p}", LITTLE, thumb=VRM1_THUMB),
    "Godot": family(
        "LeftHand", "Left{word}{p}", LITTLE, thumb={k: v.replace("left", "Left") for k, v in VRM1_THUMB.items()}
    ),
    "Unreal": family("hand_l", "{low}_0{n}_l"),
    "Rigify": family("hand.L", "f_{low}.0{n}.L", thumb={(0, p): f"thumb.0{p + 1}.L" for p in range(3)}),
    "Rigify DEF": family("DEF-hand.L", "DEF-f_{low}.0{n}.L", thumb={(0, p): f"DEF-thumb.0{p + 1}.L" for p in range(3)}),
    "VRoid": family("J_Bip_L_Hand", "J_Bip_L_{word}{n}", LITTLE),
    "Auto-Rig Pro": family("hand.l", "{low}{n}.l"),
    "Auto-Rig Pro controls": family("c_hand_fk.l", "c_{low}{n}.l"),
    "Character Creator": family("CC_Base_L_Hand", "CC_Base_L_{word}{n}", ("Thumb", "Index", "Mid", "Ring", "Pinky")),
    "Daz": family("lHand", "l{word}{n}", ("Thumb", "Index", "Mid", "Ring", "Pinky")),
    "Daz Genesis 9": family("l_hand", "l_{low}{n}", ("Thumb", "Index", "Mid", "Ring", "Pinky")),
    "Biped": family("Bip01 L Hand", "Bip01 L Finger{f}{m}"),
    "Biped 001": family("Bip001 L Hand", "Bip001 L Finger{f}{m}"),
    "SMPL-X": family("left_wrist", "left_{low}{n}"),
    "MakeHuman": family("wrist.L", "finger{g}-{n}.L"),
    "VRChat": family("Left wrist", "{word}Finger{n}_L", LITTLE, thumb={(0, p): f"Thumb{p}_L" for p in range(3)}),
    "Motive": family("Skeleton 001_LHand", "Skeleton 001_L{word}{n}"),
    "MMD": family("左手首", "左{word}{n}", MMD, thumb={(0, p): f"左親指{chr(0xFF10 + p)}" for p in range(3)}),
    "MMD in Blender": family("手首.L", "{word}{n}.L", MMD, thumb={(0, p): f"親指{p}.L" for p in range(3)}),
    "MMD in English": family(
        "wrist_L",
        "{low}{n}_L",
        ("thumb", "fore", "middle", "third", "little"),
        thumb={(0, p): f"thumb{p}_L" for p in range(3)},
    ),
    "Xsens": family(
        "LeftHand",
        "",
        thumb={
            (f, p): f"Left{XSENS[f]}{(('MC', 'PP', 'DP') if f == 0 else ('PP', 'MP', 'DP'))[p]}"
            for f in range(5)
            for p in range(3)
        },
    ),
}


_SIDES = (
    ("Left", "Right"),
    ("left", "right"),
    ("左", "右"),
    (r"^l(?=_|[A-Z])", "r"),
    (r"(?<=[_ ])L(?=[_ ]|[A-Z][a-z])", "R"),
    (r"(?<=[._])l$", "r"),
    (r"(?<=[._])L$", "R"),
)


def mirrored(name):
    """The name of the same bone of the right hand."""
    return next(re.sub(old, new, name) for old, new in _SIDES if re.search(old, name))


@pytest.mark.parametrize("rig", FAMILIES)
def test_the_fingers_of_every_family_are_found(rig):
    hand, fingers = FAMILIES[rig]
    others = ["Hips", "Spine", "LeftForeArm", "lForearm", "upperarm_l", "LeftFoot", "l_toe"]
    names = [hand, *fingers.values(), *(mirrored(name) for name in (hand, *fingers.values())), *others]
    found = find_bones(names)
    assert found["left"].hand == hand
    assert dict(found["left"].fingers) == fingers
    assert found["right"].hand == mirrored(hand)
    assert dict(found["right"].fingers) == {at: mirrored(name) for at, name in fingers.items()}


def test_a_bone_that_deforms_is_preferred_to_its_control():
    both = ["f_index.01.L", "DEF-f_index.01.L", "c_ring2.l", "ring2.l"]
    fingers = find_bones(both)["left"].fingers
    assert fingers == {(1, 0): "DEF-f_index.01.L", (3, 1): "ring2.l"}


def test_a_rig_without_fingers_has_none():
    assert not find_bones(["Hips", "LeftHand", "RightHand"])["left"].fingers


def test_no_name_means_two_bones():
    seen: dict[str, tuple] = {}
    for side in ("left", "right"):
        for finger in range(len(FINGERS)):
            for part in range(3):
                for name in finger_names(side, finger, part):
                    assert seen.setdefault(name, (side, finger, part)) == (side, finger, part)
                    assert plain(name) == name


def test_the_clients_tables_are_up_to_date():
    sys.path.insert(0, str(CLIENTS))
    import generate

    for path, text in generate.files().items():
        if path.stem in ("rig_names", "RigNameTable"):
            assert path.read_text(encoding="utf-8") == text, f"run clients/generate.py: {path}"
