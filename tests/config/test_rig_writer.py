"""Written rig files: a configuration survives being printed and read, and a calibration changes nothing else."""

from dataclasses import fields, replace
from ipaddress import ip_network
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from manipnet import cli
from manipnet.common.options import ConfigError
from manipnet.config.rig_reader import load_rig
from manipnet.config.rig_writer import rig_text, store
from manipnet.config.settings import (
    WRISTS,
    ActorConfig,
    BodyConfig,
    ObjectConfig,
    ServerConfig,
    protocol_options,
)
from manipnet.geometry import quat_exp
from manipnet.inputs.natnet.options import NatNetOptions
from manipnet.outputs.zeromq import ZmqOutputOptions
from manipnet.synthesis.objects.library import library_file
from manipnet.wire.hand_names import ANGLE_NAMES

# --- printed and read


numbers = st.floats(-2.0, 2.0)
names = st.text(st.characters(codec="utf-8", exclude_categories=["Cs", "Cc"]), min_size=1, max_size=12)
keys = st.one_of(st.integers(0, 999), names)


@st.composite
def offsets(draw) -> np.ndarray | None:
    if draw(st.booleans()):
        return None
    turn, place = (np.array(draw(st.tuples(numbers, numbers, numbers))) for _ in range(2))
    return np.concatenate([place, quat_exp(turn)])


@st.composite
def actors(draw, name: str) -> ActorConfig:
    wrists = draw(st.lists(st.sampled_from(WRISTS), min_size=1, max_size=2, unique=True))
    body = draw(st.lists(keys, min_size=len(wrists) + 2, max_size=len(wrists) + 2, unique_by=str))
    things = tuple(
        ObjectConfig(f"{name} {i}", BodyConfig(key, draw(offsets())), mesh, draw(st.sampled_from(["m", "cm"])), 0.5)
        for i, (key, mesh) in enumerate(
            zip(body[len(wrists) :], (library_file("mug") or Path(), Path(__file__)), strict=True)
        )
    )
    limits = draw(st.dictionaries(st.sampled_from(ANGLE_NAMES), st.just((-0.25, 0.75)), max_size=3))
    placed = {wrist: BodyConfig(key, draw(offsets())) for wrist, key in zip(wrists, body, strict=False)}
    return ActorConfig(name, placed, things, draw(st.floats(0.3, 3.0)), limits)


@st.composite
def configs(draw) -> ServerConfig:
    named = draw(st.lists(names, min_size=2, max_size=3, unique=True) if draw(st.booleans()) else st.just(["actor"]))
    return ServerConfig(
        tuple(draw(actors(name)) for name in named),
        host=draw(st.sampled_from(["127.0.0.1", "::1", "stage"])),
        metrics_port=draw(st.none() | st.integers(0, 65535)),
        look_ahead_s=draw(st.floats(0.0, 0.5)),
        objects=draw(st.none() | st.just(Path.cwd() / "meshes")),
        keys=draw(st.none() | st.just(Path.cwd() / "keys")),
        allow=draw(st.just(()) | st.just((ip_network("10.0.0.0/24"),))),
        protocols=(
            ZmqOutputOptions(draw(st.integers(0, 65535))),
            NatNetOptions(
                draw(st.none() | st.tuples(st.sampled_from(["motive", "10.0.0.2", "fe80::1"]), st.integers(1, 65535))),
                draw(st.booleans()),
                draw(st.none() | st.just("10.0.0.7")),
            ),
        ),
    )


def read_back(folder: Path, text: str) -> ServerConfig:
    (folder / "printed.toml").write_text(text, encoding="utf-8")
    return cli.configure(cli.build_parser().parse_args(["--rig", str(folder / "printed.toml")]))


def same(a: ServerConfig, b: ServerConfig) -> None:
    for field in fields(ServerConfig):
        if field.name not in ("actors", "rig", "takes", "protocols"):
            assert getattr(a, field.name) == getattr(b, field.name), field.name
    for options in protocol_options():
        assert a.of(options) == b.of(options)
    assert a.takes.absolute() == b.takes.absolute(), "a folder is printed in full: a rig file may lie elsewhere"
    for one, other in zip(a.actors, b.actors, strict=True):
        assert (one.name, one.hand_scale) == (other.name, other.hand_scale)
        assert one.limits.keys() == other.limits.keys()
        assert all(one.limits[name] == pytest.approx(other.limits[name]) for name in one.limits)
        assert [replace(o, body=BodyConfig(0)) for o in one.objects] == [
            replace(o, body=BodyConfig(0)) for o in other.objects
        ]
        bodies = [{**c.wrists, **{o.name: o.body for o in c.objects}} for c in (one, other)]
        assert bodies[0].keys() == bodies[1].keys()
        for name, body in bodies[0].items():
            assert body.key == bodies[1][name].key
            assert (body.offset is None) == (bodies[1][name].offset is None)
            if body.offset is not None and (offset := bodies[1][name].offset) is not None:
                assert np.allclose(body.offset, offset, atol=1e-6)


@given(config=configs())
def test_a_configuration_that_is_printed_reads_back_as_the_same(config: ServerConfig, tmp_path_factory) -> None:
    same(config, read_back(tmp_path_factory.getbasetemp(), rig_text(config)))


def test_the_effective_configuration_is_printed_and_served_as_it_is(tmp_path: Path, capsys) -> None:
    options = [
        "--mesh",
        "Box=mug",
        "--look-ahead",
        "0.2",
        "--vmc",
        "[::1]:5",
        "--objects",
        str(tmp_path),
        "--port",
        "7",
    ]
    assert cli.main([*options, "--print-config"]) == 0
    text = capsys.readouterr().out
    same(cli.configure(cli.build_parser().parse_args(options)), read_back(tmp_path, text))
    assert cli.main(["--rig", str(tmp_path / "printed.toml"), "--print-config"]) == 0
    assert capsys.readouterr().out == text


# --- a calibration stored

OFFSET = np.array([0.01, -0.02, 0.033333, 0.5, 0.5, -0.5, 0.5])
OTHER = np.array([0.0, 0.05, 0.0, 0.0, 0.0, 0.0, 1.0])

FILES = {
    "plain": """# stage two, Tuesday
[bodies]   # who is who
left_wrist = "left_wrist"   # the taped one
right_wrist = 2

[[objects]]
body = "Box"
mesh = "mug"    # ours

[server]
port = 0 # any
""",
    "inline": """hand_scale = 0.8 # small
bodies.left_wrist = { body = "left_wrist", position = [1, 2, 3] } # old
bodies.right_wrist = {body=2}
[[objects]]
name = "Box"
body = 7
mesh = "mug"
rotation = [0, 0, 0, 1]
""",
    "tables": """
[bodies.left_wrist]
# the taped one
body = "left_wrist"
[bodies.right_wrist]
body = 2
rotation = [0, 0, 0, 1]
[[objects]]
body = "Box"
mesh = "mug"
""",
    "actors": """
[[actors]]
name = "bob"
bodies.left_wrist = "bob_left"
[[actors]]
name = "actor" # second
[actors.bodies]
left_wrist = "left_wrist"
right_wrist = 2
[[actors.objects]]
body = "cup"
mesh = "mug"
[[actors.objects]]
body = "Box"
mesh = "mug"
""",
    "one line": """
actors = [{name="actor", bodies={left_wrist="left_wrist", right_wrist=2}, objects=[{body="Box", mesh="mug"}]}]
""",
}


def calibrated(path: Path) -> ActorConfig:
    actor = next(actor for actor in load_rig(path).actors if actor.name == "actor")
    wrists = {wrist: replace(body, offset=OFFSET) for wrist, body in actor.wrists.items()}
    objects = tuple(replace(o, body=replace(o.body, offset=OTHER if o.name == "Box" else None)) for o in actor.objects)
    return replace(actor, wrists=wrists, objects=objects, hand_scale=0.87654)


@pytest.mark.parametrize("kind", FILES)
def test_a_calibration_goes_into_any_rig_and_the_rest_stays(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(FILES[kind], encoding="utf-8")
    before = load_rig(path)
    actor = calibrated(path)
    backup = store(path, actor)
    assert backup.read_text(encoding="utf-8") == FILES[kind]
    after = load_rig(path)
    (found,) = (other for other in after.actors if other.name == "actor")
    assert found.hand_scale == pytest.approx(0.8765, abs=1e-4)
    for wrist, body in found.wrists.items():
        assert body.key == actor.wrists[wrist].key
        assert body.offset is not None
        assert np.allclose(body.offset, OFFSET, atol=1e-6)
    for thing in found.objects:
        assert (thing.body.offset is None) == (thing.name != "Box")
    assert after.server == before.server
    assert [a.name for a in after.actors] == [a.name for a in before.actors]
    comments = [line.partition("#")[2] for line in FILES[kind].splitlines() if "#" in line]
    text = path.read_text(encoding="utf-8")
    assert all(comment in text for comment in comments)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["rig.toml", "rig.toml.bak"]
    store(path, replace(actor, hand_scale=1.1))
    assert backup.read_text(encoding="utf-8") == text, "the backup is what was there before"


def test_line_ends_and_permissions_stay(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_bytes(FILES["plain"].replace("\n", "\r\n").encode())
    path.chmod(0o640)
    store(path, calibrated(path))
    lines = path.read_bytes().splitlines(keepends=True)
    assert sum(line.endswith(b"\r\n") for line in lines) >= FILES["plain"].count("\n")
    assert path.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda path: path.unlink(), "No such file"),
        (lambda path: path.write_text("[bodies\n"), "could not be changed"),
        (
            lambda path: path.write_text('[[actors]]\nname = "x"\nbodies.left_wrist = 1\n'),
            "no longer has an actor 'actor'",
        ),
        (
            lambda path: path.write_text('[bodies]\nleft_wrist = 1\nright_wrist = 2\n[[objects]]\nbody = "B"\n'),
            "object",
        ),
        (lambda path: path.write_bytes(b"\xff\xfe"), "could not be changed"),
    ],
)
def test_a_file_that_cannot_be_changed_stays_as_it_is_and_the_lines_to_add_are_shown(
    spoil, reason: str, tmp_path: Path
) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(FILES["plain"], encoding="utf-8")
    actor = calibrated(path)
    spoil(path)
    left = path.read_bytes() if path.exists() else None
    with pytest.raises(ConfigError) as error:
        store(path, actor)
    assert reason in str(error.value)
    assert "left_wrist = {body = " in str(error.value)
    assert (path.read_bytes() if path.exists() else None) == left
    assert [p.name for p in tmp_path.iterdir()] == ([] if left is None else ["rig.toml"])
