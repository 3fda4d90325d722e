"""Findings about bodies whose tracking is noisy."""

from collections.abc import Iterator
from math import degrees
from typing import Final

from manipnet.runtime.diagnosis.finding import Finding, Report

MUCH_M: Final = 3e-3
MUCH_DEGREES: Final = 1.5
"""Up to this noise (standard deviation per axis) smoothing keeps the fingers calm."""


def of_noise(report: Report) -> Iterator[Finding]:
    """The wrists and props that tremble more than smoothing can take out."""
    actors = report.get("actors", {})
    for actor, about in actors.items():
        for role, body in about.get("bodies", {}).items():
            noise_m, noise_degrees = body["noise_m"], degrees(body["noise_rad"])
            if noise_m > MUCH_M or noise_degrees > MUCH_DEGREES:
                part = f"{actor}: {role}" if len(actors) > 1 else role
                yield Finding(
                    "problem",
                    f"{part}: the tracking of body {body['body']!r} trembles by {1e3 * noise_m:.1f} mm and "
                    f"{noise_degrees:.1f}°",
                    "calibrate the tracking system again, spread the markers of this body further apart, and look for "
                    "reflections, loose markers and occlusion; fingers tremble less with a longer look-ahead",
                )
