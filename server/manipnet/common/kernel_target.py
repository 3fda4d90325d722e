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
    """Let numba compile for the portable target where possible, else for this very processor; returns which it is.

    `NUMBA_CPU_NAME` in the environment takes precedence.
    """
    # numba would read a changed environment again when it first compiles, and forget what is chosen here
    config.reload_config()
    if config.CPU_NAME:  # pyright: ignore[reportAttributeAccessIssue]: set at run time
        return f"{config.CPU_NAME} {config.CPU_FEATURES}"  # pyright: ignore[reportAttributeAccessIssue]
    features = llvm.get_host_cpu_features()
    has = {name for name, present in features.items() if present}
    if platform.machine() not in ("x86_64", "AMD64") or not has.issuperset(_FEATURES):
        return f"{llvm.get_host_cpu_name()} {features.flatten()}"
    config.CPU_NAME, config.CPU_FEATURES = PORTABLE, ""  # pyright: ignore[reportAttributeAccessIssue]
    return f"{PORTABLE} "
