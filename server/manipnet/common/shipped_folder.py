"""Where an installation keeps the compiled kernels that it brings along. Found without loading the compiler."""

import sys
import sysconfig
from pathlib import Path
from typing import Final

FOLDER: Final = "kernels"
"""In the package."""


def interpreter_and_platform() -> str:
    """What the names of the folders for this interpreter and platform begin with."""
    return f"{sys.implementation.cache_tag}-{sysconfig.get_platform()}"


def brings_kernels(package: Path) -> bool:
    """Whether kernels for this interpreter and platform are there; the processor may still be too old for them."""
    return any((package / FOLDER).glob(f"{interpreter_and_platform()}-*"))
