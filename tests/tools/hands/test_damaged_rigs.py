"""Files that no hand can be imported from are refused with the remedy; unusual ones give the same hand."""

import copy
import json
import struct

import numpy as np
import pytest
from awkward_rigs import RADIUS_M, awkward_rig
from test_importing import rig, write_bvh

from manipnet.geometry import SIDES
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.hands.importing import import_profile
from manipnet_tools.hands.rig_file import RigFileError

MODEL = shipped_hand()
DRACO, MESHOPT = "KHR_draco_mesh_compression", "EXT_meshopt_compression"
FLIP = np.diag([-1.0, 1.0, 1.0, 1.0])


class Avatar:
    """A rig as a document that tests change, and its binary chunk."""

    def __init__(self, content):
        length = struct.unpack_from("<I", content, 12)[0]
        self.document, self.binary = json.loads(content[20 : 20 + length]), content[28 + length :]
        self.nodes = self.document["nodes"]
        self.number = {node["name"]: k for k, node in enumerate(self.nodes)}
        self.attributes = self.document["meshes"][0]["primitives"][0]["attributes"]

    def node(self, name):
        return self.nodes[self.number[name]]

    def content(self):
        text = json.dumps(self.document).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        if self.binary is not None:
            chunks += struct.pack("<I4s", len(self.binary), b"BIN\0") + self.binary
        return b"glTF" + struct.pack("<2I", 2, 12 + len(chunks)) + chunks

    def place(self, accessor):
        """Where the data of an accessor are in the binary chunk."""
        view = self.document["bufferViews"][self.document["accessors"][accessor]["bufferView"]]
        return slice(view["byteOffset"], view["byteOffset"] + view["byteLength"])

    def overwrite(self, accessor, value):
        place = self.place(accessor)
        data = np.full((place.stop - place.start) // 4, value, "<f4").tobytes()
        self.binary = self.binary[: place.start] + data + self.binary[place.stop :]

    def add_view(self, data):
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)}
        self.document["bufferViews"].append(view)
        self.binary += data
        self.document["buffers"][0]["byteLength"] = len(self.binary)
        return len(self.document["bufferViews"]) - 1

    def mirror(self, node):
        """Turn a node inside out, but leave its children where they are."""
        for each, before in ((node, False), *((self.nodes[child], True) for child in node["children"])):
            matrix = np.array(each["matrix"]).reshape(4, 4).T
            each["matrix"] = (FLIP @ matrix if before else matrix @ FLIP).T.ravel().tolist()


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return awkward_rig(tmp_path_factory.mktemp("rig") / "fox.glb")


@pytest.fixture(scope="module")
def expected(plain):
    return import_profile(plain, "a", MODEL, lambda _: None)


@pytest.fixture
def avatar(plain):
    return Avatar(plain.read_bytes())


def imported(folder, avatar, said=None):
    file = folder / "a.glb"
    file.write_bytes(avatar.content() if isinstance(avatar, Avatar) else avatar)
    return import_profile(file, "a", MODEL, (lambda _: None) if said is None else said.append)


def draco(avatar):
    primitive = avatar.document["meshes"][0]["primitives"][0]
    primitive["extensions"] = {DRACO: {"bufferView": 0, "attributes": {"POSITION": 0}}}
    for accessor in (*avatar.attributes.values(), primitive["indices"]):
        del avatar.document["accessors"][accessor]["bufferView"]


def meshopt(avatar):
    avatar.document["bufferViews"][0]["extensions"] = {MESHOPT: {"buffer": 0, "byteLength": 64, "count": 8}}
    avatar.document["extensionsRequired"] = [MESHOPT]


def external(avatar):
    avatar.document["buffers"], avatar.binary = [{"uri": "body.bin", "byteLength": 9}], None


def binary_is_missing(avatar):
    avatar.binary = None


def unknown_extension(avatar):
    avatar.document["extensionsRequired"] = ["ACME_bones"]


def huge_count(avatar):
    avatar.document["accessors"][0]["count"] = 10**9


def huge_float(avatar):
    avatar.document["accessors"][0]["count"] = 1e300


def sparse_beyond_the_end(avatar):
    where, what = avatar.add_view(np.array([10**6], "<u4").tobytes()), avatar.add_view(bytes(12))
    avatar.document["accessors"][avatar.attributes["POSITION"]]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": where, "componentType": 5125},
        "values": {"bufferView": what},
    }


def nan_in_a_matrix(avatar):
    avatar.node("LeftHandIndex1")["matrix"][12] = float("nan")


def infinite_matrix(avatar):
    avatar.node("LeftHand")["matrix"][12] = 1e999


def nan_in_the_skin(avatar):
    avatar.overwrite(avatar.attributes["POSITION"], np.nan)


def nan_in_the_bind_matrices(avatar):
    avatar.overwrite(avatar.document["skins"][0]["inverseBindMatrices"], np.nan)


def matrix_of_three(avatar):
    avatar.node("Hips")["matrix"] = [1, 2, 3]


def cycle(avatar):
    avatar.node("Body")["children"] = [avatar.number["Armature"]]
    avatar.node("LeftHandIndex4")["children"] = [avatar.number["Body"]]


def two_parents(avatar):
    avatar.node("Body")["children"] = [avatar.number["LeftHandIndex1"]]


def child_beyond_the_end(avatar):
    avatar.node("Body")["children"] = [9999]


def negative_joint(avatar):
    avatar.document["skins"][0]["joints"][5] = -1


def joint_beyond_the_end(avatar):
    avatar.document["skins"][0]["joints"][5] = 9999


def unused_skin_without_joints(avatar):
    avatar.document["skins"].append({"name": "empty"})


def mirrored_as_a_whole(avatar):
    matrix = np.array(avatar.nodes[0]["matrix"]).reshape(4, 4).T
    avatar.nodes[0]["matrix"] = (FLIP @ matrix).T.ravel().tolist()


def scale_of_zero(avatar):
    matrix = avatar.node("LeftHand")["matrix"]
    matrix[:3], matrix[4:7], matrix[8:11] = [0, 0, 0], [0, 0, 0], [0, 0, 0]


def add_character(avatar):
    """A second one beside the first, with the same names and a skin of its own."""
    count = len(avatar.nodes)
    more = copy.deepcopy(avatar.nodes)
    for node in more:
        node.update({"children": [child + count for child in node.get("children", [])]})
    more[0]["matrix"][12] += 2.0
    more[-1]["skin"] = 1
    first = avatar.document["skins"][0]
    avatar.document["skins"].append({**first, "joints": [joint + count for joint in first["joints"]]})
    avatar.nodes.extend(more)


def first_character_without_two_fingers(avatar):
    count = len(avatar.nodes)
    add_character(avatar)
    for node in avatar.nodes[:count]:
        node["name"] = node["name"].replace("Index", "Zeige").replace("Middle", "Mittel")


def index_and_middle_finger_swapped(avatar):
    for node in avatar.nodes:
        node["name"] = node["name"].replace("Index", "?").replace("Middle", "Index").replace("?", "Middle")


def no_nodes(avatar):
    avatar.document.update({"nodes": [], "skins": [], "meshes": []})


DAMAGED = {
    draco: rf"compressed with {DRACO}; export it without compression",
    meshopt: rf"compressed with {MESHOPT}.*export it without compression",
    external: "another file, body.bin; export it as one glTF Binary",
    binary_is_missing: "cut off.*export it again",
    unknown_extension: "requires the extension ACME_bones.*export it without",
    huge_count: "has 1000000000 vertices; decimate",
    huge_float: "damaged.*accessor 0.*export it again",
    sparse_beyond_the_end: "damaged.*export it again",
    nan_in_a_matrix: "node 'LeftHandIndex1' whose place is not finite; export it again",
    infinite_matrix: "node 'LeftHand' whose place is not finite; export it again",
    nan_in_the_skin: "vertices in the mesh of 'Body' that are not finite; export it again",
    nan_in_the_bind_matrices: "vertices in the mesh of 'Body' that are not finite; export it again",
    matrix_of_three: "damaged.*export it again",
    cycle: "nodes contain each other.*export it again",
    two_parents: "is in both.*export it again",
    child_beyond_the_end: "node 9999 in node .* is not there.*export it again",
    negative_joint: "negative number.*export it again",
    unused_skin_without_joints: "damaged.*export it again",
    joint_beyond_the_end: "damaged.*export it again",
    mirrored_as_a_whole: "thumb of the left hand lies on the wrong side.*apply the negative scale",
    scale_of_zero: "no lengths at rest; export the rig with its rest pose",
    add_character: "several bones are called 'Left.*export one of them into a file of its own",
    first_character_without_two_fingers: "several bones are called 'Left.*export one of them into a file of its own",
    index_and_middle_finger_swapped: "order index, middle, ring, little finger; check the names",
    no_nodes: "holds no bones; export the skeleton",
}


@pytest.mark.parametrize("damage", DAMAGED, ids=lambda damage: damage.__name__)
def test_a_damaged_rig_is_refused_with_the_remedy(tmp_path, avatar, damage):
    damage(avatar)
    with pytest.raises(RigFileError, match=rf"a\.glb: .*{DAMAGED[damage]}"):
        imported(tmp_path, avatar)


@pytest.mark.parametrize("share", [0.001, 0.05, 0.5, 0.99])
def test_a_file_that_is_cut_off_is_refused(tmp_path, plain, share):
    content = plain.read_bytes()
    with pytest.raises(RigFileError, match=r"a\.glb: .*(copy|export) (it|or export it) again"):
        imported(tmp_path, content[: int(share * len(content))])


def sparse_skin(avatar):
    """All positions as changes of zeros, as exporters write morphed meshes."""
    accessor = avatar.document["accessors"][avatar.attributes["POSITION"]]
    positions = avatar.binary[avatar.place(avatar.attributes["POSITION"])]
    del accessor["bufferView"]
    where = avatar.add_view(np.arange(accessor["count"], dtype="<u4").tobytes())
    accessor["sparse"] = {
        "count": accessor["count"],
        "indices": {"bufferView": where, "componentType": 5125},
        "values": {"bufferView": avatar.add_view(positions)},
    }


def clothes_with_a_skin_of_their_own(avatar):
    skin = avatar.document["skins"][0]
    avatar.document["skins"].append({**skin, "joints": skin["joints"][:2]})
    avatar.nodes.append({"name": "LeftHand", "mesh": 0})  # a mesh may have the name of a bone


def bone_inside_out(avatar):
    avatar.mirror(avatar.node("LeftHand"))


def character_without_a_skin(avatar):
    add_character(avatar)
    avatar.document["skins"].pop()
    del avatar.nodes[-1]["skin"]


def vrm_is_required(avatar):
    avatar.document["extensionsRequired"] = ["VRM"]


def nameless_nodes_and_a_hand_of_unknown_name(avatar):
    avatar.nodes.extend([{"name": "-"}, {"name": "_"}])
    for side in ("Left", "Right"):
        avatar.node(f"{side}Hand")["name"] = f"{side}Tatze"


def long_chain_above(avatar):
    first, count = len(avatar.nodes), 3000
    avatar.nodes.extend({"children": [first + n + 1]} for n in range(count))
    avatar.nodes.append({"children": [0]})


@pytest.mark.parametrize(
    "change",
    [
        sparse_skin,
        clothes_with_a_skin_of_their_own,
        bone_inside_out,
        character_without_a_skin,
        vrm_is_required,
        nameless_nodes_and_a_hand_of_unknown_name,
        long_chain_above,
    ],
    ids=lambda change: change.__name__,
)
def test_an_unusual_rig_gives_the_same_hand(tmp_path, avatar, expected, change):
    change(avatar)
    found = imported(tmp_path, avatar)
    for side in SIDES:
        np.testing.assert_allclose(found.hands[side].joints, expected.hands[side].joints, atol=1e-5)
        np.testing.assert_allclose(found.hands[side].radii, expected.hands[side].radii, atol=1e-5)
        assert expected.hands[side].radii[7] == pytest.approx(RADIUS_M, abs=1e-4)


def test_a_skin_that_is_elsewhere_is_reported(tmp_path, avatar):
    """Without bind matrices, the vertices are where their bones are: the exporter meant something else."""
    said = []
    del avatar.document["skins"][0]["inverseBindMatrices"]
    profile = imported(tmp_path, avatar, said)
    assert np.isnan(profile.hands["left"].radii).sum() > 20
    assert sum("the skin does not show the radii" in line for line in said) == 2


def test_a_bone_without_a_length_is_left_out(tmp_path, avatar, expected):
    said = []
    avatar.node("LeftHandIndex2")["matrix"] = np.eye(4).ravel().tolist()
    joints = imported(tmp_path, avatar, said).hands["left"].joints
    assert np.flatnonzero(np.isnan(joints[:, 0])).tolist() == [8]
    np.testing.assert_allclose(joints[11:], expected.hands["left"].joints[11:], atol=1e-3)
    assert any("LeftHandIndex2 lies where the one before it does" in line for line in said)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda name, place: place * [np.nan, 1, 1] if name == "LeftHandIndex2" else place, "'LeftHandIndex2' is not"),
        (lambda name, place: place * 0, "no lengths at rest"),
    ],
    ids=["not finite", "no lengths"],
)
def test_a_damaged_bvh_file_is_refused_with_the_remedy(tmp_path, change, reason):
    nodes = [(name, parent, change(name, place)) for name, parent, place in rig()]
    with pytest.raises(RigFileError, match=rf"a\.bvh: .*{reason}.*; export"):
        import_profile(write_bvh(tmp_path / "a.bvh", nodes), "a", MODEL, lambda _: None)


def test_a_bvh_file_of_two_characters_is_refused(tmp_path):
    text = write_bvh(tmp_path / "a.bvh", rig()).read_text()
    hierarchy, motion = text.split("MOTION")
    (tmp_path / "a.bvh").write_text(f"{hierarchy}{hierarchy.removeprefix('HIERARCHY')}MOTION{motion}")
    with pytest.raises(RigFileError, match=r"has two roots.*export each into a file of its own"):
        import_profile(tmp_path / "a.bvh", "a", MODEL, lambda _: None)
    same = [(name.replace("Right", "Left"), parent, place) for name, parent, place in rig()]
    with pytest.raises(RigFileError, match="several bones are called 'Left"):
        import_profile(write_bvh(tmp_path / "b.bvh", same), "b", MODEL, lambda _: None)


@pytest.mark.parametrize(
    ("table", "reason"),
    [
        ({"left": 5}, "left must be"),
        ({"left": {"wrist": ["x"]}}, "no bone"),
        ({"left": {"wrist": "LeftHand", "thumb_tip": "LeftHand"}}, "given for left wrist and for left thumb_tip"),
        ({"left": {"wrist": "LeftHand"}, "right": {"wrist": "LeftHand"}}, "left wrist and for right wrist"),
    ],
)
def test_a_map_that_contradicts_itself_is_refused(tmp_path, plain, table, reason):
    (tmp_path / "map.json").write_text(json.dumps(table))
    with pytest.raises(RigFileError, match=rf"map\.json: .*{reason}"):
        import_profile(plain, "a", MODEL, lambda _: None, tmp_path / "map.json")
