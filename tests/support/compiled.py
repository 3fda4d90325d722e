"""Lets tests call functions that otherwise only kernels call."""

from numba import njit

from manipnet.common.kernel_compiler import KernelCompiler


@njit(pipeline_class=KernelCompiler)
def call(function, *arguments):
    """The result of a compiled `function`."""
    return function(*arguments)
