"""Compiled loops: numba's `njit` with a cache that notices every change of the package.

Numba keeps compiled code per function and renews it when that function's own file changes, not when a constant or a
function it uses does. Here the cache folder is named by the state of the whole package, so an update never runs stale
machine code, and it is the user's own folder, so a read-only installation is cached too.
"""

import hashlib
import math
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import njit, types
from numba.core import cgutils, config
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array
from numba.np.numpy_support import as_dtype
from platformdirs import user_cache_dir

from manipnet.common import kernel_cache

kernel = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)  # pyright: ignore
"""A compiled function that Python calls: cached on disk, without the interpreter's lock, x / 0 as NumPy has it.

Nothing in it allocates or counts references: counting those of a shape's arrays took longer than looking up distances.
"""
inner = njit(nogil=True, error_model="numpy", _nrt=False, no_cpython_wrapper=True, no_cfunc_wrapper=True)  # pyright: ignore
"""A compiled function that only kernels call: part of theirs in the cache, and without a way in that takes a tenth of
the compiling."""


def stack_array(*shape: int, dtype: Any = types.float64) -> Callable[..., Any]:
    """A function for kernels that gives an array of this shape to work in, unfilled and gone when they return.

    One place for each call in the source, so an array made in a loop is the same one every time round. With
    `NUMBA_DISABLE_JIT=1`, kernels are plain Python, and so is the array.
    """
    if config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]: set at run time
        return lambda: np.empty(shape, as_dtype(dtype))

    @intrinsic
    def array_on_stack(_):
        kind = types.Array(dtype, len(shape), "C")

        def generate(context, builder, _signature, _arguments):
            def number(value: int):
                return context.get_constant(types.intp, value)

            item = context.get_data_type(dtype)
            size = context.get_abi_sizeof(item)
            strides = [number(size * math.prod(shape[axis + 1 :])) for axis in range(len(shape))]
            data = cgutils.alloca_once(builder, item, size=number(math.prod(shape)))
            array = make_array(kind)(context, builder)
            populate_array(array, data, [number(length) for length in shape], strides, number(size), None)
            return array._getvalue()

        return kind(), generate

    return array_on_stack


matrix, vector = stack_array(3, 3), stack_array(3)
"""Room for a rotation, and for a point or direction."""

COMPILED = ("geometry.py", "synthesis", "tracking")
"""Where compiled functions are, and the constants they are compiled with; nothing else is part of the state."""

_KEEP_S = 7 * 86400.0


def cached(name: str) -> bool:
    """Whether the kernel of this name is in the cache; True as well where there is no folder for it of our own."""
    return not config.CACHE_DIR or any(Path(config.CACHE_DIR).rglob(f"*.{name}-*.nbi"))  # pyright: ignore


def seal_cache() -> None:
    """Note what is in the cache now that everything is compiled, so that the next start notices damage."""
    if _own_folder is not None:
        kernel_cache.seal_cache(_own_folder)


def _package_state() -> str:
    package = Path(__file__).parent
    digest = hashlib.sha256(numba.__version__.encode())
    files = (p for part in COMPILED for p in (package / part, *(package / part).rglob("*")))
    for path in sorted(p for p in files if p.suffix == ".py"):
        stat = path.stat()
        digest.update(f"{path.relative_to(package)} {stat.st_size} {stat.st_mtime_ns}".encode())
    return digest.hexdigest()[:16]


def _use_own_cache() -> Path | None:
    """Choose the folder of the cache, and return it; None if numba's own choice stands."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        return None
    root = Path(os.environ.get("MANIPNET_CACHE") or user_cache_dir("manipnet", appauthor=False)) / "kernels"
    folder = root / _package_state()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        for old in root.iterdir():
            if time.time() - old.stat().st_mtime > _KEEP_S:
                shutil.rmtree(old, ignore_errors=True)
        kernel_cache.check_cache(folder)
    except OSError:
        return None  # numba then falls back to the folders it knows
    config.CACHE_DIR = str(folder)  # pyright: ignore[reportAttributeAccessIssue]: set at run time
    return folder


_own_folder = _use_own_cache()
