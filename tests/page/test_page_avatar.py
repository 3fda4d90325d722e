"""An avatar that is dropped on the live page: the actor gets its hands, and can have the model's again."""

from pathlib import Path

from avatar_rigs import avatar_rig
from rig_writer import write_glb
from studio import PATIENCE_S, Studio

NOTE = "document.getElementById('drop-note').textContent.includes(%r)"


def test_an_avatar_is_dropped_and_taken_off_again(studio: Studio, tmp_path: Path) -> None:
    rig = avatar_rig("mixamo")
    nodes = list(zip(rig.names, rig.parents, rig.positions, strict=True))
    skins = [{"joints": list(range(len(nodes)))}]
    studio.page.drop("hero.glb", write_glb(tmp_path / "hero.glb", nodes, skins=skins))
    studio.page.wait_for(NOTE % "actor has the hand hero", PATIENCE_S)
    assert studio.server.ask({"op": "status"})["hand_profiles"] == [["hero", "actor"]]
    studio.open("Hands")
    studio.page.wait_for("[...document.querySelectorAll('input')].some(one => one.value === 'hero')", PATIENCE_S)
    studio.page.choose("Hand", "the model's hand")
    studio.page.wait_for("![...document.querySelectorAll('input')].some(one => one.value === 'hero')", PATIENCE_S)
    studio.page.choose("Hand", "hero")
    studio.page.wait_for("[...document.querySelectorAll('input')].some(one => one.value === 'hero')", PATIENCE_S)


def test_an_avatar_without_hands_is_refused_with_the_reason(studio: Studio, tmp_path: Path) -> None:
    rig = avatar_rig("mixamo")
    hips = [(rig.names[0], -1, rig.positions[0])]
    studio.page.drop("stump.glb", write_glb(tmp_path / "stump.glb", hips, skins=[{"joints": [0]}]))
    studio.page.wait_for(NOTE % "hand", PATIENCE_S)
    assert "stump" not in dict(studio.server.ask({"op": "status"})["hand_profiles"])
