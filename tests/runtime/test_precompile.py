"""Compiled code is found again: a start with a full cache needs no second process."""

from manipnet.jit import cached
from manipnet.runtime import precompile as first_start


def test_what_is_compiled_aside_is_found_in_the_cache() -> None:
    first_start.compile_aside()
    assert cached(first_start.SENSING)
    assert cached("_sample"), "what builds shapes"
    assert not cached("no_such_kernel")


def test_a_start_with_a_full_cache_needs_no_help() -> None:
    first_start.compile_aside()
    helper = first_start.Precompiler()
    helper.start()
    assert helper.idle
    helper.wait()
