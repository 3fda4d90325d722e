"""Several actors on the live page: the hands, the object and the calibration of each, and an avatar that is dropped."""

import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from avatar_rigs import avatar_rig
from rig_writer import write_glb
from studio import PATIENCE_S, WRISTS, Studio, clusters_of, studio_in

RIG = """
[[actors]]
name = "ann"
bodies.left_wrist = "left_wrist"
bodies.right_wrist = "right_wrist"
[[actors.objects]]
body = "Box"
mesh = "cube"

[[actors]]
name = "bob"
bodies.left_wrist = "bob_left"
bodies.right_wrist = "bob_right"
[[actors.objects]]
body = "Cup"
mesh = "mug"
"""
NOTE = "document.getElementById('drop-note').textContent.includes(%r)"
HAS = "[...document.querySelectorAll('input')].some(one => one.offsetParent && one.value === %r)"


@pytest.fixture(scope="module")
def studio(tiny_bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Studio]:
    with studio_in(tmp_path_factory.mktemp("studio"), tiny_bundle, RIG) as studio:
        yield studio


def test_an_avatar_is_dropped_for_one_actor_and_taken_off_again(studio: Studio, tmp_path: Path) -> None:
    page, rig = studio.page, avatar_rig("mixamo")
    nodes = list(zip(rig.names, rig.parents, rig.positions, strict=True))
    skins = [{"joints": list(range(len(nodes)))}]
    studio.open("Hands")
    page.choose("Actor", "bob")
    page.drop("hero.glb", write_glb(tmp_path / "hero.glb", nodes, skins=skins))
    page.wait_for(NOTE % "bob has the hand hero", PATIENCE_S)
    assert studio.server.ask({"op": "status"})["hand_profiles"] == [["hero@bob", "bob"]]
    page.wait_for(HAS % "hero", PATIENCE_S)
    page.choose("Actor", "ann")
    page.wait_for(HAS % "the model's hand", PATIENCE_S)
    page.choose("Hand", "generic")
    studio.until(lambda _: ["generic@ann", "ann"] in studio.server.ask({"op": "status"})["hand_profiles"])
    page.choose("Actor", "bob")
    page.wait_for(HAS % "hero", PATIENCE_S)
    page.choose("Hand", "the model's hand")
    studio.says("bob has the model's hand")
    page.choose("Hand", "hero")
    page.wait_for(HAS % "hero", PATIENCE_S)


def test_an_avatar_without_hands_is_refused_with_the_reason(studio: Studio, tmp_path: Path) -> None:
    rig = avatar_rig("mixamo")
    hips = [(rig.names[0], -1, rig.positions[0])]
    studio.page.drop("stump.glb", write_glb(tmp_path / "stump.glb", hips, skins=[{"joints": [0]}]))
    studio.page.wait_for(NOTE % "hand", PATIENCE_S)
    assert "stump" not in dict(studio.server.ask({"op": "status"})["hand_profiles"])


def test_the_object_of_one_actor_is_chosen(studio: Studio) -> None:
    page = studio.page
    studio.open("Objects")
    page.choose("Body", "bob: Cup")
    page.wait_for(HAS % "mug", PATIENCE_S)
    page.choose("Object", "torus")
    studio.until(lambda _: carried(studio) == {"ann": "cube", "bob": "torus"})
    page.choose("Body", "ann: Box")
    page.wait_for(HAS % "cube", PATIENCE_S)


def test_one_actor_is_calibrated_with_a_prop_of_his_own(studio: Studio) -> None:
    page = studio.page
    wrists = clusters_of(WRISTS)
    studio.bodies.update(bob_left=wrists["left_wrist"], bob_right=wrists["right_wrist"])
    studio.open("Calibrate")
    page.choose("Actor", "bob")
    page.click("The hands are on the marks")
    studio.says("Good: the hands are 1.000 times")
    studio.says("bob: left hand")
    ann, bob = tomllib.loads(studio.rig.read_text())["actors"]
    assert ann["bodies"]["left_wrist"] == "left_wrist"
    assert bob["bodies"]["left_wrist"]["body"] == "bob_left"
    page.choose("Sheet position", "under Cup")  # the prop of this actor, and not the other's
    page.wait_for(HAS % "under Cup", PATIENCE_S)


def carried(studio: Studio) -> dict[str, str]:
    """The object of each actor's only body."""
    bodies = studio.server.ask({"op": "objects"})["bodies"]
    return {actor: next(iter(props.values()))["object"] for actor, props in bodies.items()}
