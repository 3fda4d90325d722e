"""Declared options: what their flags and rig keys understand, what they refuse, and what the command line loads."""

import subprocess
import sys
from dataclasses import dataclass
from ipaddress import ip_network
from pathlib import Path
from typing import Any

import pytest

from manipnet import cli
from manipnet.common.options import (
    Choice,
    ConfigError,
    Folder,
    HostPort,
    Networks,
    Number,
    Port,
    Switch,
    Text,
    check_values,
    from_keys,
    option,
    options_of,
    parse_endpoint,
    to_toml,
)
from manipnet.config.settings import ServerConfig, all_options, protocol_options
from manipnet.synthesis.ik.pose import pose_kernel
from manipnet.synthesis.ik.solvers import SOLVERS


@dataclass(frozen=True)
class Everything:
    """One option of each kind."""

    name: str | None = option(None, Text("NAME"), "a name")
    word: str = option("a", Choice(("a", "b")), "a word")
    on: bool = option(False, Switch(), "a switch")
    at: int = option(1, Port(), "a port")
    wait_s: float = option(0.5, Number(0.0, 1.0, "seconds"), "a number", key="wait")
    where: Path | None = option(None, Folder(), "a folder")
    to: tuple[str, int] | None = option(None, HostPort(9), "another program")
    only: tuple = option((), Networks(), "networks")
    internal: int = 3


OPTIONS = {each.key: each for each in options_of(Everything)}


@pytest.mark.parametrize(
    ("key", "toml", "text", "value"),
    [
        ("name", "x", "x", "x"),
        ("word", "b", "b", "b"),
        ("at", 65535, "65535", 65535),
        ("wait", 1, "1", 1.0),
        ("to", "host", "host", ("host", 9)),
        ("to", "host:80", "host:80", ("host", 80)),
        ("to", "[::1]:80", "[::1]:80", ("::1", 80)),
        ("to", "[::1]", "[::1]", ("::1", 9)),
        ("to", "::1", "::1", ("::1", 9)),
        (
            "only",
            ["10.0.0.1", "10.1.0.0/16"],
            ["10.0.0.1", "10.1.0.0/16"],
            (ip_network("10.0.0.1"), ip_network("10.1.0.0/16")),
        ),
    ],
)
def test_a_value_is_the_same_from_a_file_and_from_a_flag(key: str, toml: Any, text: Any, value: Any) -> None:
    declared = OPTIONS[key]
    assert declared.read(toml, Path("rig"), "here") == declared.parse(text) == value
    assert declared.read(declared.kind.write(value), Path(), "here") == value


def test_a_folder_starts_at_the_rig_file_but_not_on_the_command_line() -> None:
    assert OPTIONS["where"].read("a", Path("rig"), "here") == Path("rig/a")
    assert OPTIONS["where"].parse("a") == Path("a")


@pytest.mark.parametrize(
    ("key", "toml", "complaint"),
    [
        ("name", 1, "here is 1; it must be text"),
        ("word", "c", "here is 'c'; it must be one of a, b"),
        ("word", ["a"], "here is ['a']; it must be one of a, b"),
        ("on", 1, "here is 1; it must be true or false"),
        ("at", 65536, "here is 65536; it must be a port number, 0 … 65535, where 0 stands for any free port"),
        ("at", True, "here is True; it must be a port number"),
        ("at", 1.0, "here is 1.0; it must be a port number"),
        ("wait", 1.1, "here is 1.1; it must be a number of seconds, 0 … 1"),
        ("wait", float("nan"), "here is nan; it must be a number of seconds"),
        ("wait", False, "here is False; it must be a number of seconds"),
        ("where", 3, "here is 3; it must be the path of a folder"),
        ("only", "10.0.0.1", "here is '10.0.0.1'; it must be addresses or networks, as text, for example"),
        ("only", [10], "here is [10]; it must be addresses or networks"),
        ("only", ["x" * 99], "here is list of 103 characters; it must be addresses or networks"),
        *(("to", text, "it must be HOST or HOST:PORT") for text in ("", ":80", "host:0", "host:port", "host:65536", 1)),
    ],
)
def test_a_wrong_value_is_shown_with_what_is_allowed(key: str, toml: Any, complaint: str) -> None:
    with pytest.raises(ConfigError) as error:
        OPTIONS[key].read(toml, Path(), "here")
    assert complaint in str(error.value)


@pytest.mark.parametrize(
    ("key", "text", "complaint"),
    [
        ("at", "any", "--at is 'any'; it must be a port number"),
        ("wait", "long", "--wait is 'long'; it must be a number of seconds, 0 … 1"),
        ("only", ["stage"], "--only is ['stage']; it must be addresses or networks"),
    ],
)
def test_a_wrong_flag_is_named(key: str, text: Any, complaint: str) -> None:
    with pytest.raises(ConfigError) as error:
        OPTIONS[key].parse(text)
    assert complaint in str(error.value)


def test_an_instance_takes_its_keys_is_checked_and_written() -> None:
    made = from_keys(Everything, {"wait": 0.25, "to": ("::1", 5), "of_another": 1}, internal=4)
    assert made == Everything(wait_s=0.25, to=("::1", 5), internal=4)
    check_values(made)
    assert to_toml(made) == {"word": "a", "on": False, "at": 1, "wait": 0.25, "to": "[::1]:5"}
    with pytest.raises(ConfigError, match="--at is -1; it must be a port number"):
        check_values(Everything(at=-1))


def test_an_endpoint_outside_of_the_options() -> None:
    assert parse_endpoint("host", 9) == ("host", 9)
    with pytest.raises(ConfigError, match="'host:0' is not an address; it must be HOST or HOST:PORT"):
        parse_endpoint("host:0", 9)


# --- the options of the server


def test_no_two_options_have_the_same_key() -> None:
    declared = [each.key for options in (ServerConfig, *protocol_options()) for each in options_of(options)]
    assert len(declared) == len(set(declared)) == len(all_options())


def test_every_other_field_of_a_configuration_is_known() -> None:
    others = set(ServerConfig.__slots__) - {each.field for each in options_of(ServerConfig)}
    assert others == {"actors", "protocols", "rig"}


def test_the_help_has_every_option_with_its_default(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    text = " ".join(capsys.readouterr().out.split())
    for each in all_options().values():
        assert f"{each.flag} {each.kind.metavar}".strip() in text
        assert f"{each.help} (default: {each.shown_default})" in text or not each.shown_default


def test_every_solver_of_the_table_can_be_chosen_and_has_a_kernel() -> None:
    solver = all_options()["solver"]
    for name in SOLVERS:
        assert solver.read(name, Path(), "--solver") == name
        assert callable(pose_kernel(name))


HEAVY = {
    "numpy",
    "numba",
    "onnxruntime",
    "scipy",
    "trimesh",
    "zmq",
    "msgpack",
    "websockets",
    "mcap",
    "tomlkit",
    "viser",
}


WRAPPER = """
import sys, time
from manipnet import cli
try:
    cli.main(sys.argv[1:])
finally:
    print(time.process_time(), *sys.modules, file=sys.stderr)
"""


def run_apart(*arguments: str) -> tuple[set[str], float]:
    """Run a command in a process of its own: the heavy libraries it has loaded at its end, and its processor time."""
    run = subprocess.run([sys.executable, "-c", WRAPPER, *arguments], capture_output=True, text=True, check=False)
    line = next(line for line in run.stderr.splitlines() if " sys " in line)
    seconds, *names = line.split()
    return HEAVY & {name.partition(".")[0] for name in names}, float(seconds)


@pytest.mark.parametrize("arguments", [("--help",), ("--no-such-option",), ("--port", "no-port"), ("--vmc", "host:0")])
def test_help_and_a_mistyped_option_answer_at_once(arguments: tuple[str, ...]) -> None:
    heavy, seconds = run_apart(*arguments)
    assert heavy == set()
    assert seconds < 0.3, "it was 0.06 s when this was written, and 0.09 s until the prompt came back"


def test_the_configuration_loads_neither_the_compiler_nor_the_network() -> None:
    heavy, _ = run_apart("--print-config")
    assert heavy <= {"numpy", "tomlkit", "msgpack"}
