"""What was changed while the server ran is saved into the rig file, and nothing else of it is touched."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from manipnet.common.options import ConfigError
from manipnet.config.rig_changes import save_changes
from manipnet.config.rig_reader import load_rig
from manipnet.config.settings import BodyConfig, ObjectConfig
from manipnet.synthesis.objects.library import library_file

RIG = """# our stage
bodies.left_wrist = "left_wrist"  # the old cluster
bodies.right_wrist = "right_wrist"

[[objects]]
body = "Box"  # with tape
mesh = "cube"
position = [0.0, 0.01, 0.0]

[server]
port = 7000  # the engine expects it
"""
SEVERAL = """
[[actors]]
name = "ann"
bodies = {left_wrist = 1}
objects = [{body = 3, mesh = "cube"}]
[[actors]]
name = "bob"
bodies = {left_wrist = 2}
"""


def mesh(name: str) -> Path:
    file = library_file(name)
    assert file is not None
    return file


def test_objects_places_and_the_look_ahead_are_saved_and_comments_stay(tmp_path: Path) -> None:
    rig = tmp_path / "stage.toml"
    rig.write_text(RIG)
    (actor,) = load_rig(rig).actors
    own = tmp_path / "own.ply"
    own.write_bytes(mesh("mug").read_bytes())
    place = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    (box,) = actor.objects
    objects = (
        replace(box, mesh=mesh("hammer"), scale=1.5, body=replace(box.body, offset=place)),
        ObjectConfig("Cup", BodyConfig("Cup"), own, "m", 1.0),
    )
    kept = save_changes(rig, [replace(actor, objects=objects)], 0.2)
    text = rig.read_text()
    assert kept.read_text() == RIG
    for comment in ("# our stage", "# the old cluster", "# with tape", "# the engine expects it"):
        assert comment in text
    assert 'mesh = "own.ply"' in text
    saved = load_rig(rig)
    assert saved.server == {"port": 7000, "look_ahead": 0.2}
    assert [(each.name, each.mesh.name, each.scale) for each in saved.actors[0].objects] == [
        ("Box", "hammer.ply", 1.5),
        ("Cup", "own.ply", 1.0),
    ]
    offset = saved.actors[0].objects[0].body.offset
    assert offset is not None
    np.testing.assert_allclose(offset, place)


def test_what_has_not_changed_is_not_written(tmp_path: Path) -> None:
    rig = tmp_path / "stage.toml"
    rig.write_text(RIG)
    save_changes(rig, load_rig(rig).actors, 0.5)
    assert rig.read_text() == RIG
    assert [path.name for path in tmp_path.iterdir()] == ["stage.toml"]


def test_every_actor_keeps_its_own_objects(tmp_path: Path) -> None:
    rig = tmp_path / "stage.toml"
    rig.write_text(SEVERAL)
    ann, bob = load_rig(rig).actors
    more = (*ann.objects, ObjectConfig("9", BodyConfig(9), mesh("mug"), "m", 1.0))
    carried = ObjectConfig("8", BodyConfig(8), mesh("hammer"), "m", 1.0)
    save_changes(rig, [replace(ann, objects=more), replace(bob, objects=(carried,))], 0.5)
    ann, bob = load_rig(rig).actors
    assert [(each.body.key, each.mesh.stem) for each in ann.objects] == [(3, "cube"), (9, "mug")]
    assert [(each.body.key, each.mesh.stem) for each in bob.objects] == [(8, "hammer")]


@pytest.mark.parametrize("content", ["not = [toml", SEVERAL, "", None])
def test_a_file_that_has_become_another_is_left_alone(tmp_path: Path, content: str | None) -> None:
    rig = tmp_path / "stage.toml"
    rig.write_text(RIG)
    actors = load_rig(rig).actors
    rig.unlink() if content is None else rig.write_text(content)
    with pytest.raises(ConfigError, match="nothing was saved"):
        save_changes(rig, actors, 0.2)
    assert content is None or rig.read_text() == content
