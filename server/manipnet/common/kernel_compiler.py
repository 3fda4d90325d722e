"""Numba's compiler for kernels and for the inner functions that only kernels call.

Numba optimises every function by itself, compiles it to machine code, and then optimises it again as part of each of
its callers. An inner function needs neither: its code is linked into a kernel, and the kernel is optimised once as a
whole. This takes a third off the time of a first start and does not change what a kernel computes. The module relies on
private parts of numba, whose version `pyproject.toml` therefore bounds.
"""

from collections.abc import Callable
from typing import Any

from numba import _dynfunc, njit, types  # pyright: ignore[reportAttributeAccessIssue]: a compiled module without types
from numba.core import dispatcher as numba_dispatcher
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import NativeLowering


class _QuickFlags(Flags):
    """Compiler flags that are compared by what was set, ten times faster than by all of their values.

    Numba compares them at every operator whose types it resolves.
    """

    def __hash__(self) -> int:
        return hash(tuple(sorted(self._values)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _QuickFlags) and self._values == other._values


class _InnerLibrary(JITCodeLibrary):
    """The code of one inner function, which is neither optimised as a whole nor compiled."""

    def finalize(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _KernelLibrary(JITCodeLibrary):
    """The code of a kernel and of all inner functions that it reaches."""

    def add_linking_library(self, library: Any) -> None:
        if library in self._linking_libraries:
            return
        super().add_linking_library(library)
        if isinstance(library, _InnerLibrary):
            for reached in library._linking_libraries:
                self.add_linking_library(reached)


@register_pass(mutates_CFG=True, analysis_only=False)
class _KernelLowering(NativeLowering):
    _name = "kernel_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _KernelLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().run_pass(state)


@register_pass(mutates_CFG=True, analysis_only=False)
class _InnerLowering(NativeLowering):
    _name = "inner_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _InnerLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        described = lowered.fndesc
        # Numba looks callees up by a callable, although nothing calls this one.
        name = (described.lookup_module(), described.qualname, "an inner function")
        callable_ = _dynfunc.make_function(*name, 0, lowered.env, (state.library,))
        state.targetctx.insert_user_function(callable_, described, [state.library])
        state["cr"] = lowered._replace(cfunc=callable_)
        return True


class _Compiler(CompilerBase):
    lowering: type[NativeLowering]

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.state.flags = _QuickFlags(self.state.flags)

    def define_pipelines(self) -> list[PassManager]:
        """Numba's own passes, but for the one that turns typed code into LLVM's."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        place = [each for each, _ in passes.passes].index(NativeLowering)
        passes.passes[place] = (self.lowering, "lowering of a kernel or of a part of one")
        passes._finalized = False
        passes.finalize()
        return [passes]


class KernelCompiler(_Compiler):
    """Compiles a function that Python calls, together with the inner functions that it reaches."""

    lowering = _KernelLowering


class InnerCompiler(_Compiler):
    """Compiles a function that only kernels call, up to code that can be linked into theirs."""

    lowering = _InnerLowering


class _WideArguments(numba_dispatcher._FunctionCompiler):  # pyright: ignore[reportAttributeAccessIssue]: private
    """Compiles a function once for all integers, not again for each constant and width that it is called with."""

    def fold_argument_types(self, args: Any, kws: Any) -> tuple[Any, tuple[types.Type, ...]]:
        signature, folded = super().fold_argument_types(args, kws)
        return signature, tuple(_widened(each) for each in folded)


def _widened(argument: types.Type) -> types.Type:
    plain = types.unliteral(argument)
    return types.int64 if isinstance(plain, types.Integer) else plain


def inner_function(function: Callable[..., Any], **options: Any) -> Any:
    """The compiled form of a function that only kernels call, with numba's `options`."""
    options |= {"pipeline_class": InnerCompiler, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    dispatcher: Any = njit(**options)(function)
    plain = dispatcher._compiler
    dispatcher._compiler = _WideArguments(
        plain.py_func, plain.targetdescr, plain.targetoptions, plain.locals, plain.pipeline_class
    )
    return dispatcher
