"""Compiled loops: numba's `njit` with a cache that notices every change of the package.

Numba caches compiled code per function and renews it when the file of that function changes, but not when a constant or
a function that it uses changes. So the cache folder is named after the state of the whole package, and an update never
runs stale machine code. The folder belongs to the user, so a read-only installation is cached too. It begins with the
kernels that the installation brings along, if it does.

With `NUMBA_DISABLE_JIT=1` in the environment nothing is compiled and every kernel is a Python function that a debugger
can step through, many times slower.
"""

import gc
import hashlib
import logging
import math
import os
import shutil
import sys
import sysconfig
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")  # colours every candidate that it rejects

import llvmlite
import numba
import numpy as np
from numba import njit, types
from numba.core import cgutils, config
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array
from numba.np.numpy_support import as_dtype
from platformdirs import user_cache_dir

from manipnet.common import kernel_cache, shipped_kernels
from manipnet.common.kernel_compiler import KernelCompiler, inner_function
from manipnet.common.kernel_target import choose_target

_OPTIONS: Final[dict[str, Any]] = {"nogil": True, "error_model": "numpy", "_nrt": False}
kernel = njit(cache=True, pipeline_class=KernelCompiler, **_OPTIONS)
"""A compiled function that Python calls: cached on disk, without the interpreter's lock, with x / 0 as NumPy has it.

Kernels neither allocate nor count references, which for the arrays of a shape took longer than a distance query.
"""


def inner(function: Callable[..., Any]) -> Any:
    """Mark a function that only kernels call: it becomes part of theirs, without a Python wrapper of its own."""
    if config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]: set at run time
        return function
    return inner_function(function, **_OPTIONS)


def stack_array(*shape: int, dtype: Any = types.float64) -> Callable[..., Any]:
    """A function for kernels that returns an array of this shape as working memory, on the stack and not initialised.

    Each call in the source has its own memory, so a call inside a loop returns the same array every time.
    """
    if config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]: set at run time
        return lambda: np.empty(shape, as_dtype(dtype))

    @intrinsic
    def allocate(_):
        array_type = types.Array(dtype, len(shape), "C")

        def generate(context, builder, _signature, _arguments):
            def constant(value: int):
                return context.get_constant(types.intp, value)

            item = context.get_data_type(dtype)
            size = context.get_abi_sizeof(item)
            strides = [constant(size * math.prod(shape[axis + 1 :])) for axis in range(len(shape))]
            data = cgutils.alloca_once(builder, item, size=constant(math.prod(shape)))
            array = make_array(array_type)(context, builder)
            populate_array(array, data, [constant(length) for length in shape], strides, constant(size), None)
            return array._getvalue()

        return array_type(), generate

    return allocate


matrix, vector = stack_array(3, 3), stack_array(3)
"""Working memory for a rotation, and for a point or direction."""

_log = logging.getLogger(__name__)

COMPILED = ("geometry.py", "synthesis", "tracking", "actors/soundness.py")
"""Where compiled functions are, and the constants that are compiled into them; nothing else is part of the state."""

_KEEP_S = 7 * 86400.0
_PACKAGE: Final = Path(__file__).parent


@contextmanager
def collection_paused() -> Iterator[None]:
    """Pause Python's garbage collection, which would take an eighth of the time of compiling."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def cached(name: str) -> bool:
    """Whether the kernel of this name is in the cache. True if there is no cache folder of our own, too."""
    return not config.CACHE_DIR or any(Path(config.CACHE_DIR).rglob(f"*.{name}-*.nbi"))  # pyright: ignore


def seal_cache() -> None:
    """Note what is in the cache now that everything is compiled, so that the next start notices damage."""
    if _own_folder is not None:
        kernel_cache.seal_cache(_own_folder)


def ship_kernels(into: Path) -> int:
    """Write all kernels that are in the cache below a folder, from which an installation takes them.

    Returns the number of files. Raises `OSError` and `ValueError`.
    """
    if _own_folder is None or not shipped_kernels.can_ship():
        raise ValueError("kernels can only be shipped from a cache of our own, made by numba 0.68 or later")
    return shipped_kernels.ship(_PACKAGE, _package_state(), _own_folder, into)


def _package_state() -> str:
    """A name for everything on which compiled code depends: sources, compiler, interpreter and processor."""
    compiler, interpreter = (numba.__version__, llvmlite.__version__), sys.implementation.cache_tag
    about = *compiler, interpreter, sysconfig.get_platform(), choose_target()
    digest = hashlib.sha256(repr(about).encode())
    parts = (*COMPILED, "jit.py", "common/kernel_compiler.py")
    files = (p for part in parts for p in (_PACKAGE / part, *(_PACKAGE / part).rglob("*")))
    for path in sorted(p for p in files if p.suffix == ".py"):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _use_own_cache() -> Path | None:
    """Choose the folder of the cache, and return it; None if numba's own choice stands."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        return None
    root = Path(os.environ.get("MANIPNET_CACHE") or user_cache_dir("manipnet", appauthor=False)) / "kernels"
    state = _package_state()
    path = hashlib.sha256(str(_PACKAGE).encode())  # numba names folders after the path of the sources
    folder = root / f"{state}-{path.hexdigest()[:8]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        for old in root.iterdir():
            if time.time() - old.stat().st_mtime > _KEEP_S:
                shutil.rmtree(old, ignore_errors=True)
        shipped_kernels.use_shipped(_PACKAGE, state, folder)
        kernel_cache.check_cache(folder)
    except OSError as error:
        _log.warning("the folder %s cannot be used for compiled code (%s); numba chooses another one", folder, error)
        return None
    config.CACHE_DIR = str(folder)  # pyright: ignore[reportAttributeAccessIssue]: set at run time
    return folder


_own_folder = _use_own_cache()
