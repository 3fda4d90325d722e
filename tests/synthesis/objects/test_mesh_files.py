"""Mesh files as exporters write them: they are read as the surface that was meant, or refused for the true reason."""

import base64
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from glb_writer import FACES, Glb, box, box_glb, pack

from manipnet.synthesis.objects.foreign import foreign_format
from manipnet.synthesis.objects.mesh import ClosedMesh, MeshError, closed_mesh, load_mesh
from manipnet.synthesis.objects.repair import signed_volume
from manipnet.synthesis.objects.shape import build_shape

INWARD = FACES[:, ::-1]
Part = tuple[np.ndarray, np.ndarray]
CUBE = box(0.04, 0.04, 0.04)
OUTER, CAVITY, CORE = box(0.05, 0.05, 0.05), box(0.03, 0.03, 0.03), box(0.01, 0.01, 0.01)


def together(*parts: Part) -> Part:
    starts = np.cumsum([0, *(len(points) for points, _ in parts)])
    faces = [corners + start for (_, corners), start in zip(parts, starts, strict=False)]
    return np.concatenate([points for points, _ in parts]), np.concatenate(faces)


def write_obj(path: Path, *parts: Part) -> Path:
    """Every part is a group of its own."""
    lines, start = [], 1
    for n, (points, corners) in enumerate(parts):
        lines += [f"g part{n}", *(f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in points)]
        lines += ["f " + " ".join(str(c + start) for c in corner) for corner in corners]
        start += len(points)
    path.write_text("\n".join(lines) + "\n")
    return path


def write_stl(path: Path, *parts: Part) -> Path:
    points, corners = together(*parts)
    trimesh.Trimesh(points, corners, process=False).export(path)
    return path


def volume_cm3(mesh: ClosedMesh) -> float:
    return 1e6 * signed_volume(mesh.vertices, mesh.faces)


RIGHT, INSIDE_OUT = (box(0.04, 0.05, 0.04), FACES), (box(0.03, 0.03, 0.03, (0.12, 0, 0)), INWARD)


@pytest.mark.parametrize("write", [write_obj, write_stl])
def test_a_part_that_is_inside_out_is_turned(tmp_path: Path, write: Callable[..., Path]) -> None:
    path = write(tmp_path / f"part.{write.__name__[-3:]}", RIGHT, INSIDE_OUT)
    mesh = load_mesh(path)
    assert volume_cm3(mesh) == pytest.approx(856.0)
    shape = build_shape(mesh, tmp_path)
    distances_mm = 1e3 * shape.signed_distance(np.array([[0, 0, 0], [0.12, 0, 0], [0.17, 0, 0]], float))[0]
    np.testing.assert_allclose(distances_mm, [-40.0, -30.0, 20.0], atol=0.01)


OUT, IN, CORE_OUT = (OUTER, FACES), (CAVITY, INWARD), (CORE, FACES)


@pytest.mark.parametrize(
    ("parts", "expected_cm3"),
    [
        ([OUT, IN], 784.0),
        ([OUT, (CAVITY, FACES)], 784.0),  # a program has turned each shell outward by itself
        ([(OUTER, INWARD), (CAVITY, FACES)], 784.0),
        ([(OUTER, INWARD), (CAVITY, INWARD)], 784.0),
        ([OUT, IN, CORE_OUT], 792.0),
        ([(OUTER, INWARD), (CAVITY, FACES), (CORE, INWARD)], 792.0),
        ([CORE_OUT, (CAVITY, FACES), OUT], 792.0),
        ([OUT, (box(0.01, 0.01, 0.01, (0.02, 0, 0)), FACES), (box(0.01, 0.01, 0.01, (-0.02, 0, 0)), INWARD)], 984.0),
        ([OUT, (box(0.02, 0.02, 0.02, (0.05, 0, 0)), INWARD)], 1064.0),  # a handle that reaches into the body
        ([(OUTER, INWARD), (OUTER + np.array([0.2, 0, 0]), INWARD), (CAVITY + np.array([0.2, 0, 0]), INWARD)], 1784.0),
    ],
)
def test_each_shell_is_turned_by_how_it_is_nested(parts: list[Part], expected_cm3: float) -> None:
    assert volume_cm3(closed_mesh(*together(*parts), "nested")) == pytest.approx(expected_cm3)


def test_faces_that_are_right_keep_their_arrays() -> None:
    points, faces = together(OUT, IN, CORE_OUT)
    np.testing.assert_array_equal(closed_mesh(points, faces, "nested").faces, faces)


def test_single_faces_that_are_turned_are_turned_back() -> None:
    faces = FACES.copy()
    faces[[1, 4, 5]] = faces[[1, 4, 5], ::-1]
    assert volume_cm3(closed_mesh(CUBE, faces, "cube")) == pytest.approx(512.0)


def read(folder: Path, glb: Glb | bytes) -> ClosedMesh:
    path = folder / "box.glb"
    path.write_bytes(glb if isinstance(glb, bytes) else glb.bytes())
    return load_mesh(path)


def check(mesh: ClosedMesh, half: float = 0.04, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
    np.testing.assert_allclose(mesh.vertices.min(axis=0), np.array(centre) - half, atol=2e-5)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), np.array(centre) + half, atol=2e-5)
    assert volume_cm3(mesh) == pytest.approx(8e6 * half**3, rel=1e-3)


def scaled(glb: Glb, scale: float) -> Glb:
    glb.document["nodes"][0]["scale"] = [scale] * 3
    return glb


def requiring(glb: Glb, *names: str) -> Glb:
    glb.document["extensionsRequired"] = glb.document["extensionsUsed"] = list(names)
    return glb


@pytest.mark.parametrize(
    ("kind", "normalized", "stored", "scale"),
    [
        ("i2", True, 32767, 0.04),
        ("i1", True, 127, 0.04),
        ("i2", False, 1000, 4e-5),
        ("i1", False, 100, 4e-4),
    ],
)
@pytest.mark.parametrize("stride", [None, 8])
def test_quantised_positions(
    tmp_path: Path, kind: str, normalized: bool, stored: int, scale: float, stride: int | None
) -> None:
    glb = box_glb(np.round(CUBE / 0.04 * stored), kind, stride=stride, normalized=normalized)
    check(read(tmp_path, requiring(scaled(glb, scale), "KHR_mesh_quantization")))


@pytest.mark.parametrize(("kind", "stored"), [("u2", 65535), ("u1", 255)])
def test_unsigned_normalised_positions(tmp_path: Path, kind: str, stored: int) -> None:
    glb = box_glb(np.where(CUBE > 0, stored, 0), kind, normalized=True)
    glb.document["nodes"][0] |= {"scale": [0.08] * 3, "translation": [-0.04] * 3}
    check(read(tmp_path, requiring(glb, "KHR_mesh_quantization")))


def test_sparse_positions(tmp_path: Path) -> None:
    glb = Glb()
    start = CUBE.copy()
    start[[1, 6]] = 9.0
    position = glb.array(start)
    where, what = glb.view(np.array([1, 6], "<u2").tobytes()), glb.view(CUBE[[1, 6]].astype("<f4").tobytes())
    glb.document["accessors"][position]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": where, "componentType": 5123},
        "values": {"bufferView": what},
    }
    glb.primitive["attributes"]["POSITION"] = position
    glb.primitive["indices"] = glb.array(FACES.reshape(-1, 1), "u4")
    check(read(tmp_path, glb))
    del glb.document["accessors"][position]["bufferView"]  # all values are zero but those that are given
    with pytest.raises(MeshError):
        read(tmp_path, glb)


def test_data_in_the_document(tmp_path: Path) -> None:
    glb = box_glb(CUBE)
    data = glb._data
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    glb.document["buffers"] = [{"byteLength": len(data), "uri": uri}]
    check(read(tmp_path, pack(glb.document, b"")))


def test_triangles_without_indices_and_in_strips_and_fans(tmp_path: Path) -> None:
    glb = Glb()
    glb.primitive["attributes"]["POSITION"] = glb.array(CUBE[FACES].reshape(-1, 3))
    check(read(tmp_path, glb))
    sides = [(0, 1, 2, 3), (4, 6, 5, 7), (0, 4, 1, 5), (2, 3, 6, 7), (0, 2, 4, 6), (1, 5, 3, 7)]
    for mode in (5, 6):
        glb = Glb()
        position = glb.array(CUBE)
        quads = [side if mode == 5 else (side[0], side[1], side[3], side[2]) for side in sides]
        indices = [glb.array(np.array(quad).reshape(-1, 1), "u1") for quad in quads]
        glb.document["meshes"][0]["primitives"] = [
            {"attributes": {"POSITION": position}, "indices": i, "mode": mode} for i in indices
        ]
        check(read(tmp_path, glb))


def test_nodes_place_their_meshes(tmp_path: Path) -> None:
    glb = box_glb(CUBE)
    turn = [0.0, 0.0, 2**-0.5, 2**-0.5]
    glb.document["nodes"] = [
        {"children": [1], "translation": [0.1, 0.0, 0.0], "rotation": turn},
        {"children": [2], "scale": [-0.5, 0.5, 0.5]},  # mirrored
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0.2, 0, 1]},
        {"mesh": 0, "translation": [9.0, 9.0, 9.0]},  # not in the scene
    ]
    check(read(tmp_path, glb), 0.02, (0.0, 0.0, 0.0))
    glb.document["nodes"][0]["children"] = [1, 3]
    glb.document["nodes"][3]["extensions"] = {"KHR_node_visibility": {"visible": False}}
    check(read(tmp_path, glb), 0.02, (0.0, 0.0, 0.0))


def test_instances(tmp_path: Path) -> None:
    glb = scaled(box_glb(CUBE), 0.5)
    places = glb.array(np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]]))
    turns = glb.array(np.array([[0.0, 0.0, 0.0, 32767], [0.0, 32767, 0.0, 0.0]]), "i2", normalized=True)
    glb.document["nodes"][0]["extensions"] = {
        "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places, "ROTATION": turns, "_ID": 0}}
    }
    mesh = read(tmp_path, requiring(glb, "EXT_mesh_gpu_instancing"))
    assert volume_cm3(mesh) == pytest.approx(2 * 64.0, rel=1e-4)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [0.12, 0.02, 0.02], atol=1e-5)


def test_a_skinned_mesh_is_in_the_pose_of_the_file(tmp_path: Path) -> None:
    glb = box_glb(CUBE)
    owners = np.zeros((8, 4))
    owners[:, 0] = np.arange(8) >= 4
    weights = np.tile([255.0, 0.0, 0.0, 0.0], (8, 1))
    glb.primitive["attributes"] |= {
        "JOINTS_0": glb.array(owners, "u1"),
        "WEIGHTS_0": glb.array(weights, "u1", normalized=True),
    }
    glb.document["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [5.0, 5.0, 5.0]},  # which a skinned mesh does not follow
        {"children": [2], "translation": [0.0, 0.1, 0.0]},
        {"translation": [0.02, 0.0, 0.0]},
    ]
    bind = np.tile(np.eye(4).reshape(1, 16), (2, 1))
    glb.document["skins"] = [{"joints": [1, 2], "inverseBindMatrices": glb.array(bind)}]
    glb.document["scenes"] = [{"nodes": [0, 1]}]
    mesh = read(tmp_path, glb)
    np.testing.assert_allclose(mesh.vertices[:4], CUBE[:4] + np.array([0.0, 0.1, 0.0]), atol=1e-6)
    np.testing.assert_allclose(mesh.vertices[4:], CUBE[4:] + np.array([0.02, 0.1, 0.0]), atol=1e-6)


def test_morph_weights(tmp_path: Path) -> None:
    glb = box_glb(CUBE)
    glb.primitive["targets"] = [{"POSITION": glb.array(CUBE)}, {"NORMAL": 0}]
    glb.document["meshes"][0]["weights"] = [0.5, 1.0]
    check(read(tmp_path, glb), 0.06)
    glb.document["nodes"][0]["weights"] = [0.0, 0.0]
    check(read(tmp_path, glb), 0.04)


MESHOPT = "EXT_meshopt_compression"
DRACO = "KHR_draco_mesh_compression"


def meshopt_glb(fallback: bool) -> Glb:
    glb = box_glb(CUBE)
    glb.document["bufferViews"][0]["extensions"] = {MESHOPT: {"buffer": 0, "byteLength": 64, "count": 8}}
    if fallback:
        glb.document["bufferViews"][0]["buffer"] = 1
        size = glb.document["bufferViews"][-1]
        glb.document["buffers"] = [
            {"byteLength": size["byteOffset"] + size["byteLength"]},
            {"byteLength": 96, "extensions": {MESHOPT: {"fallback": True}}},
        ]
    return glb


def draco_glb(accessor_has_data: bool) -> Glb:
    glb = box_glb(CUBE)
    if not accessor_has_data:
        for accessor in glb.document["accessors"]:
            del accessor["bufferView"]
    glb.primitive["extensions"] = {DRACO: {"bufferView": 0, "attributes": {"POSITION": 0}}}
    return glb


@pytest.mark.parametrize(
    ("glb", "name"),
    [
        (requiring(meshopt_glb(False), MESHOPT), MESHOPT),
        (requiring(meshopt_glb(True), "KHR_mesh_quantization", MESHOPT), MESHOPT),
        (requiring(meshopt_glb(False), "KHR_meshopt_compression"), "KHR_meshopt_compression"),
        (meshopt_glb(True), MESHOPT),
        (requiring(draco_glb(False), DRACO), DRACO),
        (draco_glb(False), DRACO),
    ],
)
def test_compression_is_refused_by_its_name(tmp_path: Path, glb: Glb, name: str) -> None:
    with pytest.raises(MeshError, match=rf"is compressed with {name}.*export it without compression"):
        read(tmp_path, glb)


def test_what_is_stored_beside_the_compressed_data_is_read(tmp_path: Path) -> None:
    check(read(tmp_path, meshopt_glb(False)))
    check(read(tmp_path, draco_glb(True)))


def test_draco_is_read_where_its_library_is(tmp_path: Path) -> None:
    draco = pytest.importorskip("DracoPy")
    glb = draco_glb(False)
    view = glb.view(draco.encode(CUBE.astype(np.float32), FACES.astype(np.uint32), quantization_bits=14))
    glb.primitive["extensions"][DRACO]["bufferView"] = view
    check(read(tmp_path, requiring(glb, DRACO)))


def test_required_extensions_are_honoured_or_named(tmp_path: Path) -> None:
    for name in ("KHR_texture_transform", "KHR_materials_unlit", "EXT_texture_webp", "KHR_lights_punctual"):
        check(read(tmp_path, requiring(box_glb(CUBE), name)))
    with pytest.raises(MeshError, match="requires the extension ACME_folded_space, which cannot be read"):
        read(tmp_path, requiring(box_glb(CUBE), "ACME_folded_space"))


def _damaged(change: Callable[[dict[str, Any]], object]) -> bytes:
    glb = box_glb(CUBE)
    data = glb._data
    glb.document["buffers"] = [{"byteLength": len(data)}]
    change(glb.document)
    return pack(glb.document, data)


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"", "is not a glTF Binary file: it does not begin with glTF; export it again"),
        (json.dumps({"asset": {}}).encode(), r"it is a \.gltf file: export it as glTF Binary"),
        (struct.pack("<4sII", b"glTF", 1, 20) + bytes(8), "is glTF 1; only glTF 2 can be read"),
        (box_glb(CUBE).bytes()[:-60], "is cut off"),
        (_damaged(lambda d: d["accessors"][0].update(count=9)), "is cut off: 9 elements do not fit into buffer view 0"),
        (_damaged(lambda d: d["accessors"][0].update(count=10**12)), "vertices; decimate the mesh first"),
        (_damaged(lambda d: d["bufferViews"][1].update(byteLength=999)), "is cut off: buffer view 1 ends at"),
        (_damaged(lambda d: d["accessors"][0].update(type="VEC2")), "damaged glTF file .accessor 0 is VEC2"),
        (_damaged(lambda d: d["buffers"][0].update(uri="box.bin")), r"keeps its data in another file, box\.bin"),
        (_damaged(lambda d: d["nodes"][0].update(children=[0])), "node 0 is in it twice|contain each other"),
        (_damaged(lambda d: d["nodes"].clear()), "damaged glTF file .IndexError"),
        (_damaged(lambda d: d["meshes"][0]["primitives"][0].update(mode=1)), "holds no triangles"),
        (_damaged(lambda d: d["meshes"][0].update(primitives=3)), "damaged glTF file .TypeError"),
    ],
)
def test_a_damaged_glb_is_refused_with_the_reason(tmp_path: Path, data: bytes, complaint: str) -> None:
    with pytest.raises(MeshError, match=complaint):
        read(tmp_path, data)


@pytest.mark.parametrize(
    ("file", "content", "reason"),
    [
        ("mug.fbx", b"", "is FBX, which cannot be read; open it in Blender"),
        ("mug.FBX", b"", "is FBX"),
        ("mug.obj", b"Kaydara FBX Binary  \0", "is FBX"),
        ("mug.blend", b"BLENDER", "is a Blender file, which cannot be read; open it in Blender and export"),
        ("mug.usdz", b"PK", "is USD"),
        ("mug.ply", b"#usda 1.0", "is USD"),
        ("mug.gltf", b"{}", "is glTF in several files, which cannot be read; export it as glTF Binary"),
        ("mug.stl", b"glTF\2\0\0\0", r"is a glTF Binary; rename it to \.glb"),
        ("mug.step", b"", "is a CAD model, which cannot be read; export its surface as STL"),
        ("mug.glb", b"version https://git-lfs.github.com/spec/v1\n", "fetch the file with `git lfs pull`"),
    ],
)
def test_other_formats_are_refused_with_the_way_round(tmp_path: Path, file: str, content: bytes, reason: str) -> None:
    (tmp_path / file).write_bytes(content)
    with pytest.raises(MeshError, match=reason):
        load_mesh(tmp_path / file)


def test_files_that_are_read_are_not_foreign(tmp_path: Path) -> None:
    for file in ("a.obj", "a.ply", "a.stl", "a.glb"):
        (tmp_path / file).write_bytes(b"glTF" if file == "a.glb" else b"solid")
        assert foreign_format(tmp_path / file) is None


@pytest.mark.parametrize(
    ("size", "hint"),
    [
        (80.0, r"is 80 m across; .*if the file is in mm \(8 cm across\), set its unit"),
        (12.0, r"if the file is in cm \(12 cm across\) or in \(30.5 cm across\), set its unit"),
        (3.5, r"if the file is in dm \(35 cm across\) or cm \(3.5 cm across\) or in \(8.89 cm across\), set"),
        (0.0001, "set its unit or scale"),
    ],
)
def test_an_implausible_size_names_the_units_that_would_fit(size: float, hint: str) -> None:
    with pytest.raises(MeshError, match=hint):
        closed_mesh(box(size / 2, size / 2, size / 2), FACES, "box")


def test_a_mesh_without_extent_is_refused_for_the_true_reason() -> None:
    with pytest.raises(MeshError, match="has all its vertices at one place; export the surface again"):
        closed_mesh(np.zeros((8, 3)), FACES, "box")
