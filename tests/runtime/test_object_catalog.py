"""Objects from files: the user's folder, files that change while a session runs, and swaps between two ticks."""

import gc
import os
import threading
from pathlib import Path

import numpy as np
import pytest
import trimesh

from manipnet.actors.actor import Actor
from manipnet.actors.props import HYSTERESIS_M, Prop
from manipnet.config.settings import default_actor
from manipnet.runtime import object_catalog, shape_process
from manipnet.runtime.mesh_watch import MeshWatch
from manipnet.runtime.object_catalog import MAX_UNUSED, ObjectCatalog
from manipnet.runtime.shape_process import make_shape
from manipnet.synthesis.model.bundle import Bundle, load_bundle
from manipnet.synthesis.objects import shape_cache
from manipnet.synthesis.objects.library import library_names
from manipnet.synthesis.objects.mesh import MeshError
from manipnet.synthesis.objects.shape import Shape, load_shape
from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import BodyFrame, BodySample

LIBRARY = {
    *("cube", "cylinder", "sphere", "torus", "prism", "tetrahedron", "hemisphere"),
    *("mug", "bottle", "bowl", "hammer", "wine_glass"),
}


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MANIPNET_CACHE", str(tmp_path_factory.mktemp("cache")))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "meshes").mkdir()
    return tmp_path / "meshes"


def box(path: Path, size_m: float) -> None:
    trimesh.creation.box((size_m, size_m, size_m)).export(path)
    # a clock that is too coarse must not hide the change
    stat = path.stat()
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns + round(1e9 * size_m)))


def size_of(shape) -> float:
    return float(np.ptp(shape.bounds, axis=0)[0])


def test_the_library_is_complete() -> None:
    assert set(library_names()) == LIBRARY


def test_a_folder_adds_to_the_library_and_comes_before_it(folder: Path) -> None:
    catalog = ObjectCatalog(folder, "cm", load_shape)
    assert set(catalog.names()) == LIBRARY
    box(folder / "crate.stl", 7.0)
    box(folder / "cube.obj", 9.0)
    (folder / "notes.txt").write_text("no mesh")
    assert set(catalog.names()) == LIBRARY | {"crate"}, "the folder is read again"
    assert size_of(catalog.shape("crate")) == pytest.approx(0.07, abs=1e-6)
    assert size_of(catalog.shape("cube")) == pytest.approx(0.09, abs=1e-6)
    assert catalog.shape("crate") is catalog.shape("crate"), "built once"
    with pytest.raises(MeshError, match="object 'spoon' is unknown; allowed are bottle, bowl, crate, cube"):
        catalog.shape("spoon")


def test_files_of_the_folder_that_are_no_objects_are_named_with_the_reason(folder: Path) -> None:
    catalog = ObjectCatalog(folder, build=load_shape)
    box(folder / "cup.obj", 0.05)
    box(folder / "cup.ply", 0.06)
    (folder / "mug.fbx").touch()
    (folder / "notes.txt").write_text("no mesh")
    assert "cup" not in catalog.names(), "neither file is taken for the other"
    problems = catalog.problems()
    assert set(problems) == {"cup.obj", "cup.ply", "mug.fbx"}
    assert problems["cup.ply"] == "cup.obj and cup.ply would be the same object; rename one of them"
    assert "is FBX, which cannot be read; open it in Blender" in problems["mug.fbx"]


def test_a_rigs_mesh_comes_before_the_folders(folder: Path, tmp_path: Path) -> None:
    box(folder / "crate.stl", 0.05)
    box(tmp_path / "crate.stl", 0.08)
    catalog = ObjectCatalog(folder, build=load_shape)
    shape = catalog.load(tmp_path / "crate.stl")
    assert catalog.shape("crate") is shape
    assert catalog.add(folder / "crate.stl") is catalog.shape("crate"), "an added file comes first"


def test_a_changed_file_is_built_again_once_nobody_is_writing_it(folder: Path) -> None:
    path = folder / "crate.ply"
    box(path, 0.05)
    catalog = ObjectCatalog(folder, build=load_shape)
    old = catalog.shape("crate")
    assert catalog.changed() == []
    box(path, 0.06)
    assert catalog.changed() == [], "somebody may still be writing it"
    box(path, 0.07)
    assert catalog.changed() == [], "somebody was still writing it"
    ((before, after),) = catalog.changed()
    assert before is old
    assert size_of(after) == pytest.approx(0.07, abs=1e-6)
    assert catalog.shape("crate") is after
    assert catalog.changed() == []
    path.touch()
    assert (catalog.changed(), catalog.changed()) == ([], []), "the same content is not a change"
    path.unlink()
    assert (catalog.changed(), catalog.changed()) == ([], [])
    assert "crate" not in catalog.names()


@pytest.mark.parametrize("content", [b"", b"ply\nnonsense", b"solid x\nendsolid x\n"])
def test_a_file_that_becomes_invalid_is_named_and_its_shape_stays(folder: Path, content: bytes, caplog) -> None:
    path = folder / "crate.ply"
    box(path, 0.05)
    catalog = ObjectCatalog(folder, build=load_shape)
    old = catalog.shape("crate")
    path.write_bytes(content)
    assert (catalog.changed(), catalog.changed()) == ([], [])
    assert catalog.shape("crate") is old
    assert str(path) in catalog.problems()["crate.ply"]
    assert "a mesh file has changed, but its new content cannot be used" in caplog.text
    box(path, 0.06)
    catalog.changed()
    assert len(catalog.changed()) == 1
    assert catalog.problems() == {}


def test_the_watch_goes_on_until_a_swap_is_accepted(folder: Path) -> None:
    path, done, tries = folder / "crate.ply", threading.Event(), []
    box(path, 0.05)
    catalog = ObjectCatalog(folder, build=load_shape)
    catalog.shape("crate")

    def swap(old, new) -> None:
        tries.append((old, new))
        if len(tries) < 2:
            raise RuntimeError("busy")
        done.set()

    watch = MeshWatch(catalog, swap)
    box(path, 0.06)
    watch.start()
    assert done.wait(60.0)
    watch.stop()
    assert len(tries) == 2


def test_a_file_that_was_never_read_is_prepared_by_another_process(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = folder / "crate.ply"
    box(path, 0.05)
    here = load_shape(path, "m", 2.0)
    monkeypatch.setenv("MANIPNET_CACHE", str(tmp_path / "empty"))
    there = make_shape(path, "m", 2.0)
    monkeypatch.setattr(shape_process, "ChildProcess", None)
    again = make_shape(path, "m", 2.0)
    assert again.content_hash == here.content_hash
    monkeypatch.undo()
    assert (there.name, there.content_hash) == (here.name, here.content_hash)
    np.testing.assert_array_equal(there.mesh.vertices, here.mesh.vertices)
    np.testing.assert_array_equal(there.mesh.faces, here.mesh.faces)
    path.write_bytes(b"ply, they said")
    with pytest.raises(MeshError, match=r"crate\.ply: "):
        make_shape(path, "m", 1.0)


# --- hands at objects that change


@pytest.fixture(scope="module")
def bundle(tiny_bundle: Path) -> Bundle:
    return load_bundle(tiny_bundle)


class Scene:
    """An actor with two props, seen tick by tick."""

    def __init__(self, bundle: Bundle, catalog: ObjectCatalog) -> None:
        shape = catalog.shape("cube")
        self.actor = Actor(
            default_actor(), [Prop("cup", "cube", shape), Prop("pot", "cube", shape)], bundle, Telemetry(), 0.0
        )
        for prop in self.actor.props:
            self.actor.carry(prop.name, prop.object, prop.shape, 1.0)
        self._frames = 0

    def tick(self, left: float, right: float, cup: float = -0.2, pot: float = 0.2):
        """The plan of the next tick, with everything at these places along x."""
        places = {"left_wrist": left, "right_wrist": right, "cup": cup, "pot": pot}
        bodies = tuple(BodySample(None, name, (x, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), True) for name, x in places.items())
        t_s = self._frames / 60
        self._frames += 1
        self.actor.push(BodyFrame(t_s, None, bodies, t_s, "zmq:test"))
        tick = self.actor.poll(t_s)
        assert tick is not None
        return self.actor.plan(tick)

    def held(self) -> dict[str, str | None]:
        return {side: hand.prop for side, hand in self.actor.hands.items()}


def test_two_objects_one_in_each_hand_at_the_same_time(bundle: Bundle) -> None:
    catalog = ObjectCatalog(build=load_shape)
    scene = Scene(bundle, catalog)
    scene.actor.carry("pot", "sphere", catalog.shape("sphere"), 1.5)
    plan = scene.tick(left=-0.12, right=0.12)
    assert scene.held() == {"left": "cup", "right": "pot"}
    assert (plan.scenes["left"].shape.name, plan.scenes["left"].scale) == ("cube", 1.0)
    assert (plan.scenes["right"].shape.name, plan.scenes["right"].scale) == ("sphere", 1.5)


def test_a_hand_turns_to_another_object_only_when_it_is_clearly_nearer(bundle: Bundle) -> None:
    scene = Scene(bundle, ObjectCatalog())
    palm = 0.09  # in front of a right wrist
    scene.tick(left=-1.0, right=-0.03 - palm)
    assert scene.held()["right"] == "cup"
    seen = []
    for step in np.linspace(0.0, 0.04, 41):
        scene.tick(left=-1.0, right=-palm + step)
        seen.append(scene.held()["right"])
    first = seen.index("pot")
    assert 2.0 * np.linspace(0.0, 0.04, 41)[first] == pytest.approx(HYSTERESIS_M, abs=0.003)
    for step in (0.005, -0.005) * 10:  # back about the middle: it stays
        scene.tick(left=-1.0, right=-palm + step)
        assert scene.held()["right"] == "pot"


def test_the_next_tick_uses_a_swapped_or_changed_shape(bundle: Bundle, folder: Path) -> None:
    path = folder / "crate.ply"
    box(path, 0.05)
    catalog = ObjectCatalog(folder, build=load_shape)
    scene = Scene(bundle, catalog)
    assert scene.tick(-0.3, 0.1).scenes["right"].shape.name == "cube"
    crate = catalog.shape("crate")
    scene.actor.carry("pot", "crate", crate, 1.0)
    assert scene.tick(-0.3, 0.1).scenes["right"].shape is crate
    box(path, 0.06)
    watch = MeshWatch(catalog, scene.actor.reshape)
    watch.look()
    watch.look()
    plan = scene.tick(-0.3, 0.1)
    assert size_of(plan.scenes["right"].shape) == pytest.approx(0.06, abs=1e-6)
    assert plan.scenes["left"].shape.name == "cube", "nothing else changes"


def test_ticks_go_on_while_a_shape_is_built(bundle: Bundle, folder: Path) -> None:
    """A tick never waits for a builder, because it needs no lock that a builder holds."""
    box(folder / "crate.ply", 0.05)
    begun, finish = threading.Event(), threading.Event()

    def build(path: Path, unit: str, scale: float) -> Shape:
        if path.stem == "crate":  # as if it were a huge mesh
            begun.set()
            finish.wait(60.0)
        return load_shape(path, unit, scale)

    catalog = ObjectCatalog(folder, build=build)
    scene = Scene(bundle, catalog)
    builder = threading.Thread(target=catalog.shape, args=("crate",))
    builder.start()
    assert begun.wait(60.0)
    for _ in range(30):
        assert "right" in scene.tick(-0.3, 0.1).scenes
    assert catalog.names()
    assert catalog.problems() == {}
    assert catalog.shape("cube").name == "cube", "a shape that is there need not wait"
    assert builder.is_alive()
    finish.set()
    builder.join()
    assert "crate" in {shape.name for shape in catalog.shapes()}


def test_added_objects_that_nobody_carries_are_given_back(tmp_path: Path) -> None:
    catalog = ObjectCatalog(build=load_shape)
    box(tmp_path / "rig.stl", 0.05)
    rig_hash = catalog.load(tmp_path / "rig.stl").content_hash
    box(tmp_path / "held.stl", 0.06)
    held = catalog.add(tmp_path / "held.stl")
    for i in range(MAX_UNUSED + 5):
        box(tmp_path / f"more{i}.stl", 0.07 + 1e-3 * i)
        catalog.add(tmp_path / f"more{i}.stl")
    names = set(catalog.names())
    assert {"rig", "held", f"more{MAX_UNUSED + 4}"} <= names
    assert not {f"more{i}" for i in range(5)} & names
    assert catalog.shape("held") is held
    assert catalog.shape("rig").content_hash == rig_hash, "it is built again"
    assert len(catalog.shapes()) <= MAX_UNUSED + 1
    with pytest.raises(MeshError, match="object 'more0' is unknown"):
        catalog.shape("more0")


def test_large_shapes_that_nobody_carries_take_the_places_of_more_small_ones(tmp_path: Path, monkeypatch) -> None:
    catalog = ObjectCatalog(build=load_shape)
    box(tmp_path / "first.stl", 0.05)
    triangles = len(catalog.add(tmp_path / "first.stl").mesh.faces)
    monkeypatch.setattr(object_catalog, "MAX_UNUSED_TRIANGLES", 3 * triangles)
    for i in range(10):
        box(tmp_path / f"more{i}.stl", 0.07 + 1e-3 * i)
        catalog.add(tmp_path / f"more{i}.stl")
    gc.collect()
    assert {shape.name for shape in catalog.shapes()} == {"more7", "more8", "more9"}
    monkeypatch.setattr(object_catalog, "MAX_UNUSED_TRIANGLES", 1)
    box(tmp_path / "last.stl", 0.09)
    catalog.add(tmp_path / "last.stl")
    gc.collect()
    assert {shape.name for shape in catalog.shapes()} == {"last"}


def test_a_shape_that_is_requested_again_is_kept(tmp_path: Path) -> None:
    catalog = ObjectCatalog(build=load_shape)
    box(tmp_path / "first.stl", 0.05)
    catalog.add(tmp_path / "first.stl")
    for i in range(2 * MAX_UNUSED):
        box(tmp_path / f"more{i}.stl", 0.07 + 1e-3 * i)
        catalog.add(tmp_path / f"more{i}.stl")
        assert catalog.shape("first").name == "first"


def test_the_folder_of_cached_shapes_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MANIPNET_CACHE", str(tmp_path / "cache"))
    catalog = ObjectCatalog(build=load_shape)
    box(tmp_path / "first.stl", 0.05)
    catalog.add(tmp_path / "first.stl")
    first, first_mesh = sorted((tmp_path / "cache").glob("*.npz"), key=lambda file: file.name.startswith("mesh-"))
    monkeypatch.setattr(shape_cache, "MAX_FOLDER_BYTES", int(3.5 * first.stat().st_size))
    for i in range(4):
        box(tmp_path / f"more{i}.stl", 0.07 + 1e-3 * i)
        catalog.add(tmp_path / f"more{i}.stl")
    assert 1 <= len(list((tmp_path / "cache").glob("[!m]*.npz"))) <= 4
    assert not first.exists()
    assert not first_mesh.exists()
