"""What a process of the server needs and takes of the machine's memory."""

import ctypes
import sys
from contextlib import suppress
from importlib import import_module
from typing import Final

from manipnet.common.options import ConfigError

NEEDED_BYTES: Final = 1_300_000_000
"""A server with an open page reserves 1.1 GB of address space, most of which is never used."""
ARENAS: Final = 2
_M_ARENA_MAX: Final = -8
"""The number of this parameter in glibc's malloc.h."""


def check_address_space() -> None:
    """Raise `ConfigError` if the address space of this process is limited to less than a server needs.

    Under a small limit, libraries in C end the process in the middle of a session, and no error can be caught.
    """
    if sys.platform == "win32":
        return
    import resource

    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY and limit < NEEDED_BYTES:
        raise ConfigError(
            f"the address space of this process is limited to {limit / 1e9:.1f} GB, and the server needs at least "
            f"{NEEDED_BYTES / 1e9:.1f} GB; lift the limit with `ulimit -v unlimited` before the start"
        )


def share_arenas() -> None:
    """Let all threads allocate from the same few arenas of glibc; does nothing where there is no glibc.

    Otherwise each new thread may open another arena, which keeps what it once held: a server in which recordings come
    and go grows by megabytes in its first hour. Call this before threads start.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):  # another C library
            ctypes.CDLL(None).mallopt(_M_ARENA_MAX, ARENAS)


def leave_out_linear_algebra() -> None:
    """Keep Numba from loading SciPy's linear algebra, which takes 9 MB and is of no use: no kernel multiplies matrices
    by it. Call this before kernels are loaded; other code can load it later."""
    if "scipy.linalg" in sys.modules:
        return
    sys.modules["scipy.linalg"] = None  # pyright: ignore[reportArgumentType]: such a module cannot be imported
    try:
        import_module("numba.np.arraymath")  # it looks for it now, or else with the first kernel
    finally:
        del sys.modules["scipy.linalg"]
