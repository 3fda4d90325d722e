"""`manipnet keys`, as a person uses it."""

import pytest

from manipnet.net.curve_keys import read_allow_list, read_client_keys
from manipnet_tools.commands.keys import default_folder, main


@pytest.fixture
def keys(tmp_path, capsys):
    """Runs the command on a new folder. Returns its status and its output."""

    def run(*words):
        status = main(["--folder", str(tmp_path / "keys"), *words])
        output = capsys.readouterr()
        return status, output.out + output.err

    run.folder = tmp_path / "keys"
    return run


def test_from_nothing_to_a_listed_client(keys):
    status, output = keys("list")
    assert (status, "manipnet keys make server" in output) == (1, True)
    assert keys("make", "server")[0] == 0
    assert "no client may connect yet" in keys("list")[1]
    assert keys("make", "stage-pc")[0] == 0
    client = read_client_keys(keys.folder / "stage-pc.toml")
    assert f"{client.pair.public}  stage-pc" in keys("list")[1]
    assert client.pair.secret not in keys("list")[1]
    assert list(read_allow_list(keys.folder / "clients.allow").values()) == ["stage-pc"]


def test_keys_are_replaced_only_by_force_and_the_old_ones_are_revoked(keys):
    keys("make", "server")
    keys("make", "stage-pc")
    before = read_client_keys(keys.folder / "stage-pc.toml").pair.public
    status, output = keys("make", "stage-pc")
    assert (status, "already exists; give another name, or --force to replace it" in output) == (1, True)
    assert keys("make", "stage-pc", "--force")[0] == 0
    after = read_client_keys(keys.folder / "stage-pc.toml").pair.public
    assert read_allow_list(keys.folder / "clients.allow") == {after: "stage-pc"}
    assert after != before


@pytest.mark.parametrize(
    ("words", "expected"), [(("make", "../x"), "cannot be the name of a client"), (("make", "a"), "make server")]
)
def test_what_cannot_be_made_is_reported(keys, words, expected):
    if expected != "make server":
        keys("make", "server")
    status, output = keys(*words)
    assert (status, expected in output) == (1, True)


def test_a_folder_of_the_user_is_the_default():
    assert default_folder().name == "keys"
