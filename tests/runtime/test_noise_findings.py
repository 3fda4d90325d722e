"""The doctor names bodies whose tracking is too noisy, with a remedy."""

from math import radians
from typing import Any

from manipnet.runtime.diagnosis.diagnose import diagnose
from manipnet.runtime.diagnosis.noise import of_noise


def report_of(noise_mm: float, noise_degrees: float) -> dict[str, Any]:
    body = {"body": "Box", "state": "live", "age_s": 0.0, "rate_hz": 120.0}
    noise = {"noise_m": 1e-3 * noise_mm, "noise_rad": radians(noise_degrees)}
    return {"actors": {"ann": {"bodies": {"prop": body | noise}}, "bob": {"bodies": {}}}}


def test_a_body_that_trembles_is_named_with_a_remedy() -> None:
    for mm, degrees in ((4.2, 0.3), (0.4, 2.6)):
        (finding,) = of_noise(report_of(mm, degrees))
        assert finding.level == "problem"
        assert finding.text == f"ann: prop: the tracking of body 'Box' trembles by {mm:.1f} mm and {degrees:.1f}°"
        assert "markers" in finding.remedy
        assert finding in diagnose(report_of(mm, degrees))


def test_noise_that_smoothing_takes_out_is_no_problem() -> None:
    assert not list(of_noise(report_of(2.0, 1.0)))
    assert not list(of_noise({}))
