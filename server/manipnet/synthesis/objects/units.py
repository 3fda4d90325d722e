"""Units of length in which a mesh file may be."""

from typing import Final

UNITS_M: Final = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "in": 0.0254}
"""Each unit in metres."""
_PROP_SIZES_M: Final = (0.03, 0.6)


def plausible_units(size: float) -> list[str]:
    """Descriptions of the units in which `size` is that of a prop, such as `unit = "cm" (12 cm across)`."""
    sizes_m = {unit: size * metres for unit, metres in UNITS_M.items()}
    smallest, largest = _PROP_SIZES_M
    return [f"{unit} ({100 * m:.3g} cm across)" for unit, m in sizes_m.items() if smallest <= m <= largest]
