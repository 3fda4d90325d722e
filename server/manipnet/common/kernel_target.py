"""The processor that kernels are compiled for: a common kind where possible, so that compiled kernels can be shipped.

Source of the features: x86-64 psABI, microarchitecture level v3 (https://gitlab.com/x86-psABIs/x86-64-ABI).
"""

import platform
from typing import Final

import llvmlite.binding as llvm
from numba.core import config

PORTABLE: Final = "x86-64-v3"
"""Intel since Haswell (2013) and AMD since Excavator (2015). The kernels are not faster with what came later."""
_FEATURES: Final = (
    *("cx16", "popcnt", "sahf", "sse3", "sse4.1", "sse4.2", "ssse3"),
    *("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"),
)
"""What a processor of this kind has, by LLVM's names."""


def choose_target() -> str:
    """Let numba compile for the portable target where possible; returns what it compiles for, `host` if it is this very
    processor. `NUMBA_CPU_NAME` in the environment takes precedence.
    """
    if config.CPU_NAME:  # pyright: ignore[reportAttributeAccessIssue]: set at run time
        return config.CPU_NAME  # pyright: ignore[reportAttributeAccessIssue]
    has = {name for name, present in llvm.get_host_cpu_features().items() if present}
    if platform.machine() not in ("x86_64", "AMD64") or not has.issuperset(_FEATURES):
        return "host"
    config.CPU_NAME, config.CPU_FEATURES = PORTABLE, ""  # pyright: ignore[reportAttributeAccessIssue]
    return PORTABLE
