"""Presets as a browser has kept them: what does not have their form is left out, and never breaks the page."""

import json
from typing import Any

import pytest

from manipnet.page.presets import read_presets

PROP = {"object": "mug", "scale": 1.0, "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0]}
PRESET: dict[str, Any] = {
    "view": {"dark": True, "layers": ["contacts"], "camera": {"position": [0, 1, 2], "look_at": [0, 0, 0]}},
    "look_ahead_s": 0.2,
    "objects": {"actor": {"Box": PROP}},
}


def test_presets_are_read_as_they_were_kept() -> None:
    kept = {"day": PRESET, "night": {"view": {"camera": None}}}
    assert read_presets(json.dumps(kept)) == kept
    assert read_presets(None) == {}


@pytest.mark.parametrize(
    "wrong",
    [
        1,
        {},
        {"view": []},
        {"view": {"layers": 3}},
        {"view": {"camera": {"position": [0, 0, 0]}}},
        {"view": {"camera": {"position": [0, 0, float("nan")], "look_at": [0, 0, 0]}}},
        {"view": {}, "objects": [PROP]},
        {"view": {}, "objects": {"actor": PROP}},
        {"view": {}, "objects": {"actor": {"Box": {"object": "mug"}}}},
    ],
)
def test_what_is_not_a_preset_is_left_out(wrong: Any) -> None:
    assert read_presets(json.dumps({"wrong": wrong, "day": PRESET})) == {"day": PRESET}


@pytest.mark.parametrize("text", ["", "{", "[]", "3"])
def test_what_is_not_a_list_of_presets_offers_none(text: str) -> None:
    assert read_presets(text) == {}
