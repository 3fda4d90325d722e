"""Compiled code is found in the cache, and a start with a full cache needs no child process."""

from manipnet.jit import cached
from manipnet.runtime import precompile


def test_what_is_compiled_aside_is_found_in_the_cache() -> None:
    precompile.compile_aside()
    assert cached(precompile.SENSING)
    assert cached("_sample"), "a kernel that builds shapes"
    assert not cached("no_such_kernel")


def test_a_start_with_a_full_cache_needs_no_child_process() -> None:
    precompile.compile_aside()
    precompiler = precompile.Precompiler()
    precompiler.start()
    assert precompiler.idle
    precompiler.wait()
