"""Rig files and the command line: what they mean, and the error of each mistake."""

from contextlib import suppress
from dataclasses import replace
from ipaddress import ip_network
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from manipnet import cli
from manipnet.common.options import ConfigError
from manipnet.config.rig_reader import load_rig
from manipnet.config.settings import BodyConfig, ServerConfig, check, default_actor, parse_object
from manipnet.inputs.osc import OscOptions
from manipnet.inputs.zeromq import ZmqInputOptions
from manipnet.net.addresses import is_loopback
from manipnet.outputs.vmc import VmcOptions
from manipnet.outputs.zeromq import ZmqOutputOptions
from manipnet.synthesis.objects.library import library_file

LEAST = """
[bodies]
left_wrist = "left_wrist"
right_wrist = 2

[[objects]]
body = "Box"
mesh = "mug.obj"
scale = 1.0
"""


@pytest.fixture
def rig_file(tmp_path: Path):
    (tmp_path / "mug.obj").write_text("")

    def write(text: str) -> Path:
        path = tmp_path / "rig.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_the_least_rig_of_the_contract(rig_file) -> None:
    path = rig_file(LEAST)
    (actor,) = load_rig(path).actors
    assert {wrist: body.key for wrist, body in actor.wrists.items()} == {"left_wrist": "left_wrist", "right_wrist": 2}
    (thing,) = actor.objects
    assert (thing.name, thing.body.key, thing.unit, thing.scale) == ("Box", "Box", "m", 1.0)
    assert thing.mesh == path.parent / "mug.obj"


def test_several_actors_offsets_and_server_options(rig_file) -> None:
    rig = load_rig(
        rig_file("""
[server]
port = 0
look_ahead = 0.1

[[actors]]
name = "ann"
hand_scale = 0.9
[actors.bodies]
right_wrist = { body = 7, position = [0.01, 0, 0], rotation = [0, 0, 0, 2] }
[[actors.objects]]
body = 8
name = "cup"
mesh = "mug.obj"
unit = "cm"

[[actors]]
name = "bob"
bodies.left_wrist = "bob_left"
""")
    )
    ann, bob = rig.actors
    assert ann.hand_scale == 0.9
    assert ann.wrists["right_wrist"].key == 7
    np.testing.assert_array_equal(ann.wrists["right_wrist"].offset, [0.01, 0, 0, 0, 0, 0, 1])
    assert (ann.objects[0].name, ann.objects[0].unit) == ("cup", "cm")
    assert bob.wrists == {"left_wrist": BodyConfig("bob_left")}
    assert rig.server == {"port": 0, "look_ahead": 0.1}


@pytest.mark.parametrize(
    ("text", "line", "complaint"),
    [
        ("[bodies\n", None, "not TOML"),
        ("[bodies]\n", 1, "bodies is missing; it names the body of left_wrist and of right_wrist"),
        ("[bodies]\nleft = 1\n", 2, "bodies.left is not known here; allowed are left_wrist, right_wrist"),
        ("[bodies]\nleft_wrist = 1.5\n", 2, "bodies.left_wrist is 1.5; it must be a streaming id (integer) or a name"),
        ("[bodies]\nleft_wrist = ''\n", 2, "bodies.left_wrist is empty"),
        ("[bodies]\nleft_wrist = true\n", 2, "bodies.left_wrist is True"),
        ("[bodies]\nleft_wrist = {}\n", 2, "bodies.left_wrist.body is missing"),
        ("[bodies]\nleft_wrist = {body = 1, position = [0, 1]}\n", 2, "position is [0, 1]; it must be 3 numbers"),
        ("[bodies]\nleft_wrist = {body = 1, rotation = [0, 0, 0, 0]}\n", 2, "rotation is zero"),
        ("[bodies]\nleft_wrist = {body = 1, position = [nan, 0, 0]}\n", 2, "position is nan; it must be finite"),
        ("wrists = 1\n", 1, "wrists is not known here; allowed are server, bodies, objects, hand_scale"),
        ("hand_scale = 9\n[bodies]\nleft_wrist = 1\n", 1, "hand_scale is 9.0; allowed are 0.2 … 5.0"),
        (LEAST + "unit = ['cm']\n", 10, "objects[1].unit is ['cm']; it must be text"),
        (LEAST.replace("mug.obj", "m" * 5000), 8, "objects[1].mesh is str of 5002 characters; there is no file"),
        (LEAST + "unit = 'furlong'\n", 10, "objects[1].unit is 'furlong'; allowed are m, dm, cm, mm, in"),
        (LEAST + "colour = 1\n", 10, "objects[1].colour is not known here"),
        (LEAST.replace("mug", "jug"), 8, "objects[1].mesh is 'jug.obj'; there is no file"),
        (LEAST.replace("mug.obj", "jug"), 8, "and the library has bottle, bowl, cube"),
        (LEAST.replace('body = "Box"\n', ""), 6, "objects[1].body is missing"),
        ("objects = 3\n[bodies]\nleft_wrist = 1\n", 1, "objects must be tables [[objects]], not 3"),
        ("[[actors]]\nname = 3\n", 2, "actors[1].name is 3; it must be text"),
        ("[[actors]]\nname = 'a'\n[[actors]]\nbodies.left_wrist = 1\n", 1, "actors[1].bodies is missing"),
        (
            "[server]\nport = 70000\n" + LEAST,
            2,
            "server.port is 70000; it must be a port number, 0 … 65535, where 0 stands for any free port",
        ),
        ("[server]\nlook_ahead = 1\n" + LEAST, 2, "server.look_ahead is 1; it must be a number of seconds, 0 … 0.5"),
        ("[server]\nhost = 1\n" + LEAST, 2, "server.host is 1; it must be text"),
        (
            "[server]\nobjects_unit = 'yd'\n" + LEAST,
            2,
            "server.objects_unit is 'yd'; it must be one of m, dm, cm, mm, in",
        ),
        (
            "[server]\nsolver = 'magic'\n" + LEAST,
            2,
            "server.solver is 'magic'; it must be one of least_squares, wrench, ccd",
        ),
        ("[server]\nup = 'x'\n" + LEAST, 2, "server.up is 'x'; it must be one of y, z"),
        ("[server]\nvmc = 'a:b'\n" + LEAST, 2, "server.vmc is 'a:b'; it must be HOST or HOST:PORT with a port of 1"),
        ("[server]\nallow = ['stage']\n" + LEAST, 2, "server.allow is ['stage']; it must be addresses or networks"),
        ("[server]\nallow = '10.0.0.1'\n" + LEAST, 2, "server.allow is '10.0.0.1'; it must be addresses or networks"),
        ("[server]\nkeys = 1\n" + LEAST, 2, "server.keys is 1; it must be the path of a folder"),
        ("[server]\ndemo = 'yes'\n" + LEAST, 2, "server.demo is 'yes'; it must be true or false"),
        ("[server]\nport = {}\n" + LEAST, 2, "server.port is {}; it must be a port number"),
        ("limits_deg.INDEX = [0, 9]\n" + LEAST, 1, "limits_deg.INDEX is not known here; allowed are THUMB_CMC_FE, "),
        (
            "limits_deg.INDEX_PIP_FE = [9, 0]\n" + LEAST,
            1,
            "is [9, 0]; allowed are -180 <= lower < upper <= 180 degrees",
        ),
        ("limits_deg.INDEX_PIP_FE = 9\n" + LEAST, 1, "limits_deg.INDEX_PIP_FE is 9; it must be 2 numbers"),
        ("[server]\nfast = true\n" + LEAST, 2, "server.fast is not known here; allowed are demo, objects"),
    ],
)
def test_a_mistake_is_named_with_file_line_key_and_what_is_allowed(
    rig_file, text: str, line: int | None, complaint: str
) -> None:
    path = rig_file(text)
    with pytest.raises(ConfigError) as error:
        load_rig(path)
    where = f"{path}:{line}: " if line else f"{path}: "
    assert str(error.value).startswith(where)
    assert complaint in str(error.value)


def test_a_file_that_is_not_there_or_not_text_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read"):
        load_rig(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"binary\.toml: not TOML"):
        load_rig(tmp_path / "binary.toml")


@given(text=st.text(alphabet=st.sampled_from("[]{}=.,\"'#\n abodieslrwt_0123"), max_size=120))
def test_any_text_is_read_or_refused_with_our_own_error(text: str, tmp_path_factory) -> None:
    path = tmp_path_factory.getbasetemp() / "any.toml"
    path.write_text(text, encoding="utf-8")
    with suppress(ConfigError):
        load_rig(path)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"protocols": (ZmqOutputOptions(port=65536),)}, "--port is 65536; it must be a port number, 0 … 65535"),
        ({"metrics_port": -1}, "--metrics-port is -1"),
        ({"look_ahead_s": 0.6}, "--look-ahead is 0.6; it must be a number of seconds, 0 … 0.5"),
        ({"look_ahead_s": float("nan")}, "--look-ahead is nan"),
        ({"solver": "magic"}, "--solver is 'magic'; it must be one of least_squares, wrench, ccd, none"),
        ({"host": "0.0.0.0"}, "--host 0.0.0.0 can be reached from other machines"),
        ({"actors": ()}, "there are 0 actors"),
        ({"actors": (default_actor(), default_actor())}, "two actors are named 'actor'"),
        ({"actors": (default_actor((parse_object("a=x.obj"), parse_object("a=y.obj"))),)}, "two parts named 'a'"),
        ({"actors": (default_actor((parse_object("left_wrist=x.obj"),)),)}, "two parts named 'left_wrist'"),
    ],
)
def test_a_configuration_that_cannot_be_served_is_refused(change: dict, complaint: str) -> None:
    with pytest.raises(ConfigError) as error:
        check(replace(ServerConfig((default_actor(),)), **change))
    assert complaint in str(error.value)


def test_other_machines_may_connect_only_if_it_is_asked_for() -> None:
    check(ServerConfig((default_actor(),), host="0.0.0.0", insecure=True))
    keys, allow = Path("keys"), (ip_network("192.168.1.0/24"),)
    check(ServerConfig((default_actor(),), host="0.0.0.0", keys=keys, allow=allow))
    for only in ({"keys": keys}, {"allow": allow}):
        for host in ("0.0.0.0", "::", "192.168.1.4", "stage"):
            with pytest.raises(ConfigError, match="nothing keeps strangers out"):
                check(replace(ServerConfig((default_actor(),), host=host), **only))
    assert is_loopback("127.0.0.1")
    assert is_loopback("::1")
    assert is_loopback("localhost")
    assert not is_loopback("192.168.1.4")
    assert not is_loopback("stage")


@pytest.mark.parametrize("text", ["", "Box", "=mug.obj", "Box="])
def test_what_is_not_an_object(text: str) -> None:
    with pytest.raises(ConfigError, match="must be NAME=FILE"):
        parse_object(text)


def test_the_command_line_wins_over_the_rig_file(rig_file) -> None:
    path = rig_file("[server]\nport = 1234\nosc_port = 0\n" + LEAST)
    arguments = cli.build_parser().parse_args(["--rig", str(path), "--port", "0", "--vmc", "localhost"])
    config = cli.configure(arguments)
    assert config.of(ZmqOutputOptions).port == 0
    assert config.of(OscOptions).osc_port == 0
    assert config.of(ZmqInputOptions).input_port == 5556
    assert config.of(VmcOptions).vmc == ("localhost", 39539)
    assert config.actors[0].objects[0].name == "Box"


def configured(*options: str) -> ServerConfig:
    return cli.configure(cli.build_parser().parse_args(list(options)))


def test_every_key_of_a_rig_may_be_set_on_the_command_line(rig_file) -> None:
    path = rig_file("[server]\nport = 1234\n" + LEAST)
    config = configured(
        *("--rig", str(path), "--set", "bodies.left_wrist=LeftHand", "--set", "bodies.right_wrist.body = 7"),
        *("--set", "bodies.right_wrist.position=[0, 0.02, 0]", "--set", "hand_scale=0.9", "--set", "server.port=0"),
        *("--set", "limits_deg.INDEX_PIP_FE=[-5, 90]"),
    )
    (actor,) = config.actors
    assert actor.wrists["left_wrist"] == BodyConfig("LeftHand")
    assert actor.wrists["right_wrist"].key == 7
    np.testing.assert_array_equal(actor.wrists["right_wrist"].offset, [0.0, 0.02, 0.0, 0.0, 0.0, 0.0, 1.0])
    assert (actor.hand_scale, config.of(ZmqOutputOptions).port, config.rig) == (0.9, 0, path)
    assert actor.limits["INDEX_PIP_FE"] == pytest.approx(np.radians([-5, 90]))
    assert configured("--set", "bodies.left_wrist=3").actors[0].wrists["left_wrist"].key == 3


@pytest.mark.parametrize(
    ("setting", "complaint"),
    [
        ("bodies", "--set bodies: it is not KEY=VALUE with a key of a rig file, for example bodies.left_wrist=3"),
        ("=3", "--set =3: it is not KEY=VALUE"),
        ("bodies.left=1", "--set bodies.left=1: bodies.left is not known here; allowed are left_wrist, right_wrist"),
        ("hand_scale=big", "--set hand_scale=big: hand_scale is 'big'; it must be a number"),
    ],
)
def test_a_wrong_setting_is_named_with_what_is_allowed(setting: str, complaint: str) -> None:
    with pytest.raises(ConfigError) as error:
        configured("--set", setting)
    assert complaint in str(error.value)


def test_a_mesh_may_be_one_of_the_library(rig_file) -> None:
    path = rig_file(LEAST.replace("mug.obj", "mug"))
    assert load_rig(path).actors[0].objects[0].mesh == library_file("mug")
    assert parse_object("Box=mug").mesh == library_file("mug")


def test_a_rig_saved_with_a_byte_order_mark_is_read(rig_file) -> None:
    path = rig_file(LEAST)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert load_rig(path).actors[0].wrists["right_wrist"].key == 2
