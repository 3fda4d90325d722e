"""`manipnet calibrate`: the request that it sends, and what it prints."""

import pytest

from manipnet.common.options import ConfigError
from manipnet_tools.commands import calibrate
from manipnet_tools.commands.calibrate import report, request
from manipnet_tools.commands.options import CalibrateOptions


def test_the_options_become_one_request() -> None:
    assert request(CalibrateOptions()) == {
        "op": "calibrate",
        "seconds": 2.0,
        "hand": "both",
        "store": True,
        "step": "wrists",
        "sheet": [0.0, 0.0, 0.0, 0.0],
    }
    asked = request(CalibrateOptions(hand_length=0.19, at=(0.4, 0.75, 0.0), yaw=90.0, dry_run=True, actor="ann"))
    assert asked["sheet"] == pytest.approx([0.4, 0.75, 0.0, 1.570796], abs=1e-6)
    assert (asked["hand_length"], asked["store"], asked["actor"]) == (0.19, False, "ann")
    asked = request(CalibrateOptions(reference="Box", fingertips=True))
    assert (asked["reference"], asked["step"]) == ("Box", "fingertips")
    assert "sheet" not in asked


def test_the_answer_is_printed_with_its_quality() -> None:
    hand = {
        "spread_mm": 0.61,
        "spread_deg": 0.2,
        "samples": 240,
        "outliers": 2,
        "changed_mm": 31.2,
        "changed_deg": 84.0,
    }
    answer = {"quality": "good", "hand_scale": 0.868, "hands": {"left_wrist": hand}, "stored": None, "note": "lasts"}
    lines = report(answer)
    assert lines[0] == "good: the hands are 0.868 times the size of the model's"
    assert lines[1] == (
        "left_wrist: held still within 0.6 mm and 0.20° (240 samples, 2 outliers ignored); "
        "the calibration changed by 31.2 mm and 84.0°"
    )
    assert lines[2] == "lasts"
    assert "saved in rig.toml" in report(answer | {"stored": "rig.toml"})[2]


@pytest.mark.parametrize(
    ("server", "complaint"),
    [
        (
            "127.0.0.1:1",
            "no server answers at tcp://127.0.0.1:1 .* (start one with manipnet-serve|name one with --server)",
        ),
        (
            "tcp://127.0.0.1:1",
            "no server answers at tcp://127.0.0.1:1 .* (start one with manipnet-serve|name one with --server)",
        ),
        ("127.0.0.1:many", "a port of 1 … 65535"),
    ],
)
def test_without_a_server_the_remedy_is_printed(server: str, complaint: str, monkeypatch) -> None:
    monkeypatch.setattr(calibrate, "ANSWER_S", 0.05)
    with pytest.raises(ConfigError, match=complaint):
        calibrate.run(CalibrateOptions(server=server))
