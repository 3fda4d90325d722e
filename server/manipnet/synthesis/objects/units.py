"""Units of length in which a mesh file may be."""

from typing import Final

UNITS_M: Final = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "in": 0.0254}
"""Each unit in metres."""
