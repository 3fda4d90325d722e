"""Which takes a model is trained on, how much each folder counts, and under which terms the model is."""

import json

import pytest

from manipnet_tools.cli import main
from manipnet_tools.takes.dataset import DataError
from manipnet_tools.takes.sources import foreign_terms, join_licences
from manipnet_tools.training.mixture import data_folders, licence_of_mixture, require_free

FREE = "Apache-2.0; trained on takes of generated"


@pytest.fixture
def folders(tmp_path):
    """A folder like the published dataset, one of generated takes, and one with a studio's own takes."""
    for take in ("mug1", "cup1"):
        (tmp_path / "captured" / "BVH" / take).mkdir(parents=True)
    for name, licence in (("generated", "Apache-2.0"), ("own", "our own")):
        folder = tmp_path / name / "takes" / f"{name}-0"
        folder.mkdir(parents=True)
        (folder / "take.npz").write_bytes(b"")
        source = {"name": f"takes of {name}", "licence": licence, "attribution": "", "url": "", "original": ""}
        content = {"takes": {f"{name}-0": {**source, "hands": ["left", "right"], "error_mm": {}}}}
        (tmp_path / name / "sources.json").write_text(json.dumps(content))
    return tmp_path


def test_folders_have_weights(folders):
    found = data_folders([str(folders / "captured"), f"{folders / 'generated'}=2.5"], ["cup1"])
    assert [(each.path.name, each.weight, each.takes) for each in found] == [
        ("captured", 1.0, ("mug1",)),
        ("generated", 2.5, ("generated-0",)),
    ]


def test_a_folder_whose_name_has_an_equals_sign_is_a_folder(folders):
    (folders / "captured").rename(folders / "takes=2")
    (found,) = data_folders([str(folders / "takes=2")], [])
    assert (found.path.name, found.weight) == ("takes=2", 1.0)


@pytest.mark.parametrize(
    ("data", "leave_out", "reason"),
    [
        ([], [], "names no folder"),
        (["captured=0"], [], "the weight is '0'; it must be a number above 0"),
        (["captured=-1"], [], "the weight is '-1'"),
        (["captured=nan"], [], "the weight is 'nan'"),
        (["captured=inf"], [], "the weight is 'inf'"),
        (["captured=much"], [], "the weight is 'much'"),
        (["captured="], [], "the weight is ''"),
        (["captured", "captured=2"], [], "names a folder twice"),
        (["nowhere"], [], "contains no takes"),
        (["captured", "generated"], ["mug2"], "--leave-out mug2: the takes of .*captured are cup1, mug1; the takes of"),
        (["captured", "generated"], ["generated-0"], "--leave-out names every take of .*generated"),
    ],
)
def test_what_cannot_be_used_is_named(folders, data, leave_out, reason):
    with pytest.raises(DataError, match=reason):
        data_folders([f"{folders}/{each}" for each in data], leave_out)


@pytest.mark.parametrize(
    ("data", "start", "foreign"),
    [
        (["generated"], None, []),
        (["generated"], FREE, []),
        (["generated", "captured"], None, ["CC BY-NC 4.0"]),
        (["generated", "own"], None, ["our own; trained on takes of own"]),
        (["generated"], "CC BY-NC 4.0; trained on the ManipNet dataset by its authors", ["CC BY-NC 4.0"]),
        (["generated"], "not stated", ["not stated"]),
    ],
)
def test_a_mixture_has_the_terms_of_all_that_it_is_made_of(folders, data, start, foreign):
    licence = licence_of_mixture(data_folders([str(folders / each) for each in data], []), start)
    assert FREE in licence
    found = foreign_terms(licence)
    assert len(found) == len(foreign)
    assert all(part.startswith(term) for part, term in zip(found, foreign, strict=True))
    if foreign:
        with pytest.raises(DataError, match=f"because of: {foreign[0]}"):
            require_free(licence)
    else:
        require_free(licence)


def test_each_source_is_named_once():
    assert join_licences([FREE, f"{FREE} | MIT; trained on x", "MIT; trained on x"]) == f"{FREE} | MIT; trained on x"


def test_the_command_refuses_to_call_a_mixture_free(folders, capsys):
    data = [str(folders / "generated"), str(folders / "captured")]
    assert main(["train", "--free", "--data", *data, "--out", str(folders / "mine")]) == 1
    assert "--free: the model could not be used commercially, because of: CC BY-NC 4.0" in capsys.readouterr().err
    start = ["--start", "manipnet-small"]
    assert main(["train", "--free", "--data", data[0], *start, "--out", str(folders / "mine")]) == 1
    assert "because of: CC BY-NC 4.0" in capsys.readouterr().err
    assert not (folders / "mine").exists()
